"""Signals of a bus database, compiled into a table that decodes and encodes payloads without Python; multiplexing.

cantools is the reference: wherever it defines a result, `decode` gives the same number as a float and
`encode` the same bits (`rint`, half to even). Where it defines none, or one that could mislead:

- The code "not available" and the code "error" decode to NaN, and no number encodes to either of them: it
  becomes the nearest code that is neither.
- So do codes that a database excludes: named by the value table in an unbroken row up to the field's largest (such as
  65534 "Fault"), beyond 0xFA.. in J1939, or outside the declared range by more than a hundredth of it: noise about
  an end of the range is not excluded. Of an index or a counter every code counts.
- A number outside the declared minimum and maximum, or outside what the field holds, is clamped (infinities
  included). A declared range in which no code of the field lies counts as none.
- NaN encodes to "not available"; without that code to NaN in a float field, else to the number nearest zero.
- A float64 holds 53 bits. An integer wider than that decodes to the nearest float64 (half to even) when it is
  not scaled; scaled, it is the float64 product and sum, not rounded once from exact integers. Encoding a
  float64 is exact at any width.

A multiplexed signal is in a frame only where its selector has one of the values the database lists; the selector
may be multiplexed itself (extended multiplexing), so a signal has one condition for every selector above it.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from cantools.database.can import Message, Signal
from numpy.typing import NDArray

from observer_rt.bus.database.lookup import find_signal, reserved_codes
from observer_rt.core.frames import frames as core
from observer_rt.foundation.errors import UserError

ABOUT_AN_END = 0.01  # of a declared range, by which noise may leave it
_J1939_VALUES = 0xFB  # most significant byte of the first code that is none, of what is not an enumeration
_FLOAT_KIND = {32: core.FLOAT32, 64: core.FLOAT64}
_LARGEST_FLOAT = {32: float(np.finfo(np.float32).max), 64: float(np.finfo(np.float64).max)}


def signal_table(message: Message, names: Sequence[str], counter: str | None = None) -> NDArray[np.void]:
    """Compile the signals `names` of `message`, in this order, into a table of dtype `SIGNAL`.

    counter: the index or counter among them, whose every code counts.

    Raises `UserError`: a signal is missing, does not fit, has scale 0, a float of odd width, or no usable code.
    """
    table = np.zeros(len(names), core.SIGNAL)
    for row, name in zip(table, names, strict=True):
        _compile(find_signal(message, name), row, message)
        if name == counter:
            row["least"], row["most"] = -math.inf, math.inf
    return table


def _compile(signal: Signal, row: np.void, message: Message) -> None:
    location = f"message {message.name}, signal {signal.name}"
    if signal.length > 64:
        raise UserError(location, f"has {signal.length} bits, at most 64 are supported")
    if signal.scale == 0:
        raise UserError(location, "has scale 0", "correct the scale in the bus database")
    if signal.conversion.is_float and signal.length not in _FLOAT_KIND:
        raise UserError(location, f"is a float of {signal.length} bits, must be 32 or 64")
    _set_position(signal, row)
    last_byte = row["first_byte"] + row["step"] * (row["byte_count"] - 1)
    if min(row["first_byte"], last_byte) < 0 or max(row["first_byte"], last_byte) >= message.length:
        problem = f"does not fit in the {message.length} bytes of the message"
        raise UserError(location, problem, "correct the bus database")
    if signal.conversion.is_float:
        row["kind"] = _FLOAT_KIND[signal.length]
    else:
        row["kind"] = core.SIGNED if signal.is_signed else core.UNSIGNED
    row["scale"] = signal.scale
    row["offset"] = signal.offset
    _set_limits(signal, row, is_j1939=message.protocol == "j1939")
    _set_reserved_codes(signal, row, location)


def _set_position(signal: Signal, row: np.void) -> None:
    """DBC counts bits from 0 at the least significant bit of each byte, and `start` is the most significant
    bit of a big-endian signal."""
    if signal.byte_order == "little_endian":
        row["first_byte"], row["step"], row["shift"] = signal.start // 8, 1, signal.start % 8
    else:
        last_in_transmission = 8 * (signal.start // 8) + (7 - signal.start % 8) + signal.length - 1
        row["first_byte"], row["step"] = last_in_transmission // 8, -1
        row["shift"] = 7 - last_in_transmission % 8
    row["byte_count"] = (int(row["shift"]) + signal.length + 7) // 8
    row["mask"] = (1 << signal.length) - 1
    row["sign"] = 1 << (signal.length - 1)


def _set_limits(signal: Signal, row: np.void, is_j1939: bool) -> None:
    """Lowest and highest raw value by the declared range and by the field, both float64 the field holds.

    A range in which no code lies is passed over: by the field alone.
    """
    row["least"], row["most"] = -math.inf, math.inf
    if signal.conversion.is_float:
        highest = _LARGEST_FLOAT[signal.length]
        lowest = -highest
    elif signal.is_signed:
        lowest, highest = -math.ldexp(1.0, signal.length - 1), _largest_float_to((1 << signal.length - 1) - 1)
    else:
        lowest, highest = 0.0, _largest_float_to((1 << signal.length) - 1)
    largest = _largest_value(signal, is_j1939)
    if largest is not None:
        highest = row["most"] = float(largest)
    row["largest"] = highest
    # [0|0] means no range; cantools knows it, but not [0.0|0.0].
    stated = (None, None) if signal.minimum == signal.maximum == 0 else (signal.minimum, signal.maximum)
    declared = [(limit - signal.offset) / signal.scale if limit is not None else None for limit in stated]
    if signal.scale < 0:
        declared.reverse()
    if not signal.conversion.is_float:
        declared = [float(np.rint(raw)) if raw is not None else None for raw in declared]
    declared_lowest, declared_highest = declared
    first = lowest if declared_lowest is None else max(lowest, declared_lowest)
    last = highest if declared_highest is None else min(highest, declared_highest)
    if first <= last:
        margin = ABOUT_AN_END * (last - first)
        row["least"] = first - margin if first > lowest else row["least"]
        row["most"] = min(last + margin, row["most"]) if last < highest else row["most"]
        lowest, highest = first, last
    row["lowest"], row["highest"] = lowest, highest


def _largest_value(signal: Signal, is_j1939: bool) -> int | None:
    """The largest code that is a value by J1939 and by the names of the value table; None where they exclude none.

    Fields below a byte, and tables that name every code, are enumerations.
    """
    if signal.conversion.is_float or signal.length < 8:
        return None
    largest = code = (1 << signal.length - signal.is_signed) - 1
    if is_j1939 and not signal.is_signed:
        code = (_J1939_VALUES << signal.length - 8) - 1
    while code in (signal.choices or {}):
        code -= 1
    return code if 0 < code < largest else None


def _largest_float_to(limit: int) -> float:
    """The largest float64 not above `limit`: 2^64 - 1 itself would round up, out of the field."""
    nearest = float(limit)
    return nearest if int(nearest) <= limit else math.nextafter(nearest, 0.0)


def _set_reserved_codes(signal: Signal, row: np.void, location: str) -> None:
    not_available, error = reserved_codes(signal)
    reserved = [code for code in (not_available, error) if code is not None]
    for name, code in (("not_available", not_available), ("error", error)):
        if code is not None:
            row[f"has_{name}"], row[name] = True, code
            row[f"instead_of_{name}"] = _nearest_ordinary(code, reserved, row, location)


def _nearest_ordinary(code: int, reserved: list[int], row: np.void, location: str) -> int:
    """The code nearest to `code` whose value is within the limits and not reserved."""
    value = core.raw_value(code, row)
    if not row["lowest"] <= value <= row["highest"]:
        return code  # clamping keeps every number away from it
    mask = int(row["mask"])
    # At most the other reserved code stands between.
    for distance in range(1, len(reserved) + 1):
        for candidate in ((code - distance) & mask, (code + distance) & mask):
            raw = core.raw_value(candidate, row)
            wrapped_round = row["kind"] < core.FLOAT32 and abs(raw - value) > distance
            if candidate not in reserved and not wrapped_round and row["lowest"] <= raw <= row["highest"]:
                return candidate
    raise UserError(location, "all codes within its range are reserved", "correct GenSigSNA or GenSigError")


class Condition(NamedTuple):
    """The field of `selector` must hold one of `values` (its raw bits)."""

    selector: str
    values: frozenset[int]


Conditions: TypeAlias = frozenset[Condition]
"""All must hold; none: the signal is in every frame."""


class Selection(NamedTuple):
    """Conditions as compiled functions see them.

    Rows of `conditions` that follow each other with one selector are its alternatives; every selector must match.
    """

    selectors: NDArray[np.void]  # SIGNAL
    conditions: NDArray[np.void]  # CONDITION


def conditions_of(message: Message, name: str) -> Conditions:
    """Conditions under which a frame of `message` carries the signal `name`.

    Raises `UserError`: the signal or a selector is not there, or selectors select each other.
    """
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
    """Values of its selector under which a signal is sent, None: always. It may be repeated for each of them."""
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
    """Whether no frame meets both."""
    return any(
        mine.selector == yours.selector and not mine.values & yours.values for mine in first for yours in second
    )


def frame_kinds(conditions: Iterable[Conditions]) -> tuple[Mapping[str, int], ...]:
    """Selector values of as few frames as it takes to carry signals under all these conditions.

    In the order of the conditions; one frame without selectors where nothing is multiplexed.
    """
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
