"""Multiplexed signals of a database: in a frame where their selectors, perhaps multiplexed, have listed values."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple, TypeAlias

import numpy as np
from cantools.database.can import Message, Signal
from numpy.typing import NDArray

from observer_rt.bus.database.codec import signal_table
from observer_rt.bus.database.lookup import find_signal
from observer_rt.core.frames import frames as core
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Structs


class Condition(NamedTuple):
    """The field of `selector` must hold one of `values` (its raw bits)."""

    selector: str
    values: frozenset[int]


Conditions: TypeAlias = frozenset[Condition]
"""All must hold; none: the signal is in every frame."""


class Selection(NamedTuple):
    """Conditions for compiled code: rows of one selector in succession are alternatives; all selectors must match."""

    selectors: Structs  # SIGNAL
    conditions: Structs  # CONDITION


def conditions_of(message: Message, name: str) -> Conditions:
    """Conditions under which a frame carries a signal. Raises `UserError` for a missing or circular selector."""
    conditions: list[Condition] = []
    signal = find_signal(message, name)
    while (values := _multiplexer_ids(message, signal)) is not None:
        if signal.multiplexer_signal is None or len(conditions) == len(message.signals):
            problem = "is multiplexed, but by no selector that is always sent"
            remedy = "correct the multiplexing in the bus database"
            raise UserError(f"message {message.name}, signal {name}", problem, remedy)
        selector = find_signal(message, signal.multiplexer_signal)
        mask = (1 << selector.length) - 1
        conditions.append(Condition(selector.name, frozenset(value & mask for value in values)))
        signal = selector
    return frozenset(conditions)


def _multiplexer_ids(message: Message, signal: Signal) -> set[int] | None:
    """Values of its selector under which a signal is sent, None: always. A database may repeat it for each value."""
    repeated = [other for other in message.signals if other.name == signal.name]
    if any(_field(other) != _field(signal) for other in repeated):
        problem = f"is defined {len(repeated)} times, in different ways"
        remedy = "give each of them a name of its own in the bus database"
        raise UserError(f"message {message.name}, signal {signal.name}", problem, remedy)
    if any(other.multiplexer_ids is None for other in repeated):
        return None
    return {value for other in repeated for value in other.multiplexer_ids}


def _field(signal: Signal) -> tuple[object, ...]:
    """Fields of a signal that decide what its bits mean, and which other selects it."""
    conversion = signal.conversion
    bits = (signal.start, signal.length, signal.byte_order, signal.is_signed, conversion.is_float)
    return (*bits, conversion.scale, conversion.offset, signal.multiplexer_signal)


def are_exclusive(first: Conditions, second: Conditions) -> bool:
    """Whether no frame meets both sets of conditions."""
    return any(one.selector == other.selector and not one.values & other.values for one in first for other in second)


def frame_kinds(conditions: Iterable[Conditions]) -> tuple[Mapping[str, int], ...]:
    """Selector values of as few frames as carry signals under all conditions, in their order; one frame if none."""
    wanted = list(dict.fromkeys(conditions))
    kinds: list[tuple[int, dict[str, int]]] = []
    # A frame for a nested signal also carries what its outer selector alone selects: those first.
    for position, needed in sorted(enumerate(wanted), key=lambda item: -len(item[1])):
        own = {condition.selector: min(condition.values) for condition in needed}
        shared = next((n for n, (_, kind) in enumerate(kinds) if meets(own | kind, needed)), len(kinds))
        if shared == len(kinds):
            kinds.append((position, {}))
        first, kind = kinds[shared]
        kinds[shared] = min(position, first), own | kind
    return tuple(kind for _, kind in sorted(kinds, key=lambda item: item[0])) or ({},)


def meets(kind: Mapping[str, int], needed: Conditions) -> bool:
    """Whether a frame with these selector values meets the conditions."""
    return all(kind.get(condition.selector) in condition.values for condition in needed)


def blank_frame(message: Message, kind: Mapping[str, int]) -> NDArray[np.uint8]:
    """A frame of `message` of one kind: its selectors set, all else 0."""
    payload = np.zeros(message.length, np.uint8)
    for signal, value in zip(signal_table(message, list(kind)), kind.values(), strict=True):
        core.put_signal_bits(payload, signal, value)
    return payload


def compile_conditions(message: Message, conditions: Conditions) -> Selection:
    """Table of conditions for `is_selected`, selectors counted from 0."""
    in_order = sorted(conditions, key=lambda condition: condition.selector)
    rows = [(n, value) for n, condition in enumerate(in_order) for value in sorted(condition.values)]
    selectors = signal_table(message, [condition.selector for condition in in_order])
    return Selection(selectors, np.array(rows, core.CONDITION))
