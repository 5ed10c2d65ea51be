"""Which samples of a role come in one frame: all of them, or those under one value of a multiplexer."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, groupby

from cantools.database.can import Message

from observer_rt.bus.multiplexing import Conditions, are_exclusive, conditions_of
from observer_rt.errors import UserError


@dataclass(frozen=True)
class SampleGroup:
    """Samples [offset, offset + count) of a role's list, in every frame that meets `conditions`."""

    offset: int
    count: int
    conditions: Conditions


def sample_groups(message: Message, samples: Sequence[str], index: str) -> tuple[SampleGroup, ...]:
    """The groups that make up the list `samples`, in its order; `index` is the signal with their sample index.

    Raises:
        UserError: the list goes back to an earlier group, frames may carry two groups of it, or a frame with
            samples does not carry the index.
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
    for group in groups:
        if not conditions_of(message, index) <= group.conditions:
            raise UserError(
                f"message {message.name}",
                f"frames with {samples[group.offset]} need not carry the sample index {index}",
                "name an index that is in every frame with these samples",
            )
    return tuple(groups)
