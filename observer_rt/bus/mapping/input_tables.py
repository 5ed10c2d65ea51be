"""Input frames as compiled code sees them: tables of messages, of sample groups, of optional inputs and of signals.

A frame carries all samples of a role, or a group: those under one multiplexer value.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, groupby
from typing import NamedTuple

import numpy as np
from cantools.database.can import Message

from observer_rt.bus.can_frame import length_code, length_of
from observer_rt.bus.database import multiplexing
from observer_rt.bus.database.catalogue import BusMessage
from observer_rt.bus.database.codec import signal_table
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import OptionalRole, Role
from observer_rt.core.frames import frames as core
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Structs

ROLES = tuple(Role)
OPTIONAL_ROLES = tuple(OptionalRole)
ENERGIZING = len(OPTIONAL_ROLES)  # number of this input, after those of the optional roles
assert OPTIONAL_ROLES[core.LEARNING_ENABLE] is OptionalRole.LEARNING_ENABLE  # the core knows it by its number


@dataclass(frozen=True)
class SampleGroup:
    """Samples [offset, offset + count) of a role's list, in every frame that meets `conditions`."""

    offset: int
    count: int
    conditions: multiplexing.Conditions


def sample_groups(message: Message, samples: Sequence[str]) -> tuple[SampleGroup, ...]:
    """Groups of `samples` in order. Raises `UserError`: the list returns to one, or a frame carries two of them."""
    groups: list[SampleGroup] = []
    for conditions, names in groupby(samples, lambda name: multiplexing.conditions_of(message, name)):
        offset = groups[-1].offset + groups[-1].count if groups else 0
        groups.append(SampleGroup(offset, len(list(names)), conditions))
    for first, second in combinations(groups, 2):
        if not multiplexing.are_exclusive(first.conditions, second.conditions):
            raise UserError(
                f"message {message.name}",
                f"one frame can carry {samples[first.offset]} and {samples[second.offset]}, between which others "
                "are listed or the multiplexing changes",
                "list the samples in the order they are taken, those of one frame together",
            )
    return tuple(groups)


def require_carried(message: Message, index: str, groups: Sequence[SampleGroup]) -> None:
    """Raise `UserError` unless every frame with these samples also carries the signal `index`."""
    for group in groups:
        if not multiplexing.conditions_of(message, index) <= group.conditions:
            problem = f"sends {index} only with other samples than the {group.count} from number {group.offset} on"
            remedy = "name an index that is in every frame with these samples"
            raise UserError(f"message {message.name}", problem, remedy)


def require_one_rate(
    injector: BenchInjector, streams: Sequence[tuple[BusMessage, list[Role]]], steps: Sequence[int]
) -> None:
    """Raise `UserError` if a stream of a message is slower than its other streams; `steps`: of the index."""
    names = [(source.message.name, source.bus) for source, _ in streams]
    for name, (_, roles), ratio in zip(names, streams, steps, strict=True):
        if ratio > 1 and names.count(name) > 1:
            problem = f"{name[0]} carries other signals under the same sample index"
            remedy = "leave rate_hz out: all signals of one message are sampled alike"
            raise UserError(injector.location(f"signals.{roles[0]}.rate_hz"), problem, remedy)


@dataclass(frozen=True, eq=False)
class OptionalInput:
    """Signals of a message that carry an optional input, compiled."""

    names: tuple[str, ...]
    table: Structs
    """`SIGNAL`: the index of the first sample, where there is one, then its signals."""
    selection: multiplexing.Selection
    """Selector values of a multiplexed frame that carries it."""
    row: Structs
    """`OPTIONAL_INPUT`, without its places in the tables."""
    default: float
    """Value in frames that are made of a recording [unit of the database]; nan: not available."""


class Inputs(NamedTuple):
    """Tables by which compiled code decodes the input frames."""

    messages: Structs  # INPUT_MESSAGE, those with samples first
    streams: Structs  # INPUT_STREAM
    groups: Structs  # INPUT_GROUP, of all messages one after another
    optional: Structs  # OPTIONAL_INPUT, of all messages one after another
    signals: Structs  # SIGNAL, of all groups one after another, then of the optional inputs
    selection: multiplexing.Selection
    kinds: Structs  # INPUT_KIND

    timing: Structs  # TIMING, of every stream


class InputTables:
    """Rows of `Inputs`, message after message."""

    def __init__(self) -> None:
        self._groups: list[Structs] = []
        self.streams: list[tuple[int, int]] = []
        """By stream: samples of each role that the frames with one sample index carry, and its roles, a bit mask."""
        self._messages: list[Structs] = []
        self._optional: list[Structs] = []
        self._kinds: list[Structs] = []
        self._signals = [np.zeros(0, core.SIGNAL)]
        self._selectors = [np.zeros(0, core.SIGNAL)]
        self._conditions = [np.zeros(0, core.CONDITION)]

    def add_group(
        self, row: Structs, message: Message, names: Sequence[str], group: SampleGroup, counter: str | None
    ) -> None:
        """Add a group to the next stream; `names`: signals of its index or `counter`, then of its samples."""
        if len(names) > core.MAX_SIGNALS:
            problem = f"{len(names)} signals of a frame are mapped, at most {core.MAX_SIGNALS}"
            raise UserError(f"message {message.name}", problem)
        row["stream"] = len(self.streams)
        row["offset"], row["samples"] = group.offset, group.count
        table = signal_table(message, names, counter)
        self._add_signals(row, table, multiplexing.compile_conditions(message, group.conditions))
        self._groups.append(row)

    def add_message(self, row: Structs, message: Message, groups: Sequence[SampleGroup]) -> None:
        """Add a message whose groups were added just before."""
        row["first_group"], row["group_count"] = len(self._groups) - len(groups), len(groups)
        row["first_kind"] = len(self._kinds)
        in_order = sorted(groups, key=lambda group: group.offset)
        for kind in multiplexing.frame_kinds(group.conditions for group in in_order):
            frame = np.zeros((), core.INPUT_KIND)
            frame["end"] = max(g.offset + g.count for g in groups if multiplexing.meets(kind, g.conditions))
            frame["blank"][: message.length] = multiplexing.blank_frame(message, kind)
            self._kinds.append(frame)
        row["kind_count"] = len(self._kinds) - row["first_kind"]
        self._messages.append(row)

    def add_optional(self, layout: MessageLayout, inputs: Sequence[OptionalInput]) -> None:
        """Add the optional inputs of a message."""
        own = frame_row(layout)
        row = next((entry for entry in self._messages if entry["key"] == own["key"]), own)
        if row is own:
            row["first_group"] = len(self._groups)
            self._messages.append(row)
        row["first_optional"], row["optional_count"] = len(self._optional), len(inputs)
        for entry in inputs:
            optional = entry.row.copy()
            self._add_signals(optional, entry.table, entry.selection)
            self._optional.append(optional)

    def _add_signals(self, row: Structs, table: Structs, selection: multiplexing.Selection) -> None:
        """Add the table of a row's signals, and the conditions that a frame with them meets."""
        row["first_signal"], row["signal_count"] = _rows(self._signals), len(table)
        row["first_condition"], row["condition_count"] = _rows(self._conditions), len(selection.conditions)
        conditions = selection.conditions.copy()
        conditions["selector"] += _rows(self._selectors)
        self._signals.append(table)
        self._selectors.append(selection.selectors)
        self._conditions.append(conditions)

    def inputs(self, timing: Structs) -> Inputs:
        """Tables of all inputs added, with the timing of every stream."""
        return Inputs(
            np.array(self._messages, core.INPUT_MESSAGE),
            np.array(self.streams, core.INPUT_STREAM),
            np.array(self._groups, core.INPUT_GROUP),
            np.array(self._optional, core.OPTIONAL_INPUT),
            np.concatenate(self._signals),
            multiplexing.Selection(np.concatenate(self._selectors), np.concatenate(self._conditions)),
            np.array(self._kinds, core.INPUT_KIND),
            timing,
        )


def frame_row(layout: MessageLayout) -> Structs:
    """A row `INPUT_MESSAGE` with the fields by which a frame is checked; all others are 0."""
    row = np.zeros((), core.INPUT_MESSAGE)
    row["key"] = layout.key
    row["length"] = layout.length
    row["padded_length"] = length_of(length_code(layout.length))
    row["protection"] = layout.protection
    return row


def _rows(tables: Sequence[Structs]) -> int:
    return sum(len(table) for table in tables)
