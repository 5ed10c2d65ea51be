"""Which samples of a role come in one frame: all of them, or those under one value of a multiplexer."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, groupby

from cantools.database.can import Message

from observer_rt.bus.database.catalogue import BusMessage
from observer_rt.bus.database.multiplexing import Conditions, are_exclusive, conditions_of
from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import Role
from observer_rt.foundation.errors import UserError


@dataclass(frozen=True)
class SampleGroup:
    """Samples [offset, offset + count) of a role's list, in every frame that meets `conditions`."""

    offset: int
    count: int
    conditions: Conditions


def sample_groups(message: Message, samples: Sequence[str]) -> tuple[SampleGroup, ...]:
    """The groups that make up the list `samples`, in its order.

    Raises:
        UserError: the list goes back to an earlier group, or one frame may carry two groups of it.
    """
    groups: list[SampleGroup] = []
    for conditions, names in groupby(samples, lambda name: conditions_of(message, name)):
        offset = groups[-1].offset + groups[-1].count if groups else 0
        groups.append(SampleGroup(offset, len(list(names)), conditions))
    for one, other in combinations(groups, 2):
        if not are_exclusive(one.conditions, other.conditions):
            raise UserError(
                f"message {message.name}",
                f"one frame can carry {samples[one.offset]} and {samples[other.offset]}, between which others "
                "are listed or the multiplexing changes",
                "list the samples in the order they are taken, those of one frame together",
            )
    return tuple(groups)


def require_carried(message: Message, index: str, groups: Sequence[SampleGroup]) -> None:
    """Raise `UserError` unless every frame with these samples also carries the signal `index`."""
    for group in groups:
        if not conditions_of(message, index) <= group.conditions:
            raise UserError(
                f"message {message.name}",
                f"sends {index} only with other samples than the {group.count} from number {group.offset} on",
                "name an index that is in every frame with these samples",
            )


def require_one_rate(
    fitted: BenchInjector, streams: Sequence[tuple[BusMessage, list[Role]]], steps: Sequence[int]
) -> None:
    """Raise `UserError` where a stream is slower, by its step of the index, than others of its message."""
    names = [(found.message.name, found.bus) for found, _ in streams]
    for name, (_, roles), ratio in zip(names, streams, steps, strict=True):
        if ratio > 1 and names.count(name) > 1:
            raise UserError(
                fitted.place(f"signals.{roles[0]}.rate_hz"),
                f"{name[0]} carries other signals under the same sample index",
                "leave rate_hz out: all signals of one message are sampled alike",
            )
