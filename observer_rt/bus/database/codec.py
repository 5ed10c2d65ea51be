"""Signals of a bus database, compiled into a table that decodes and encodes payloads without Python.

cantools is the reference: where it defines a result, `decode` gives the same number as a float and `encode` the same
bits (`rint`, half to even). Where it defines none, or one that could mislead:

- The codes "not available" and "error" decode to NaN; a number becomes the nearest code that is neither. So do codes
  that a database excludes: named by the value table up to the field's largest in an unbroken row (such as 65534
  "Fault"), beyond 0xFA.. in J1939, or outside the declared range by over a hundredth of it, for
  noise about an end counts. All codes of an index or counter count.
- A number beyond the declared range, or the field, is clamped (infinities too); a range without a code counts as
  none.
- NaN encodes to "not available", else to NaN in a float field, else to the number nearest zero.
- A float64 holds 53 bits: a wider integer decodes to the nearest (half to even), scaled to float64 product and sum,
  not rounded once. Encoding a float64 is exact at any width.
"""

import math
from collections.abc import Sequence

import numpy as np
from cantools.database.can import Message, Signal

from observer_rt.bus.database.lookup import find_signal, reserved_codes
from observer_rt.core.frames import frames as core
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Structs

RANGE_MARGIN = 0.01  # of a declared range, by which noise may leave it
_J1939_NO_VALUE = 0xFB  # most significant byte of the first code that is no value, except in enumerations
_FLOAT_KIND = {32: core.FLOAT32, 64: core.FLOAT64}
_LARGEST_FLOAT = {32: float(np.finfo(np.float32).max), 64: float(np.finfo(np.float64).max)}


def signal_table(message: Message, names: Sequence[str], counter: str | None = None) -> Structs:
    """Compile the signals `names` of `message`, in this order, into a table of dtype `SIGNAL`.

    Every code of the `counter` (or index) counts. Raises `UserError`: a signal is missing, does not fit, has scale 0,
    a float of odd width, or no usable code.
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
    """DBC counts bits from each byte's least significant; `start` of a big-endian signal is its most significant."""
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
    """Lowest and highest raw value by declared range and field, in float64; a range without a code counts as none."""
    row["least"], row["most"] = -math.inf, math.inf
    lowest, highest = _field_range(signal)
    largest = _largest_value(signal, is_j1939)
    if largest is not None:
        highest = row["most"] = float(largest)
    row["largest"] = highest
    declared_lowest, declared_highest = _declared_range(signal)
    first, last = max(lowest, declared_lowest), min(highest, declared_highest)
    if first <= last:
        margin = RANGE_MARGIN * (last - first)
        row["least"] = first - margin if first > lowest else row["least"]
        row["most"] = min(last + margin, row["most"]) if last < highest else row["most"]
        lowest, highest = first, last
    row["lowest"], row["highest"] = lowest, highest


def _field_range(signal: Signal) -> tuple[float, float]:
    if signal.conversion.is_float:
        return -_LARGEST_FLOAT[signal.length], _LARGEST_FLOAT[signal.length]
    if signal.is_signed:
        return -math.ldexp(1.0, signal.length - 1), _largest_float_to((1 << signal.length - 1) - 1)
    return 0.0, _largest_float_to((1 << signal.length) - 1)


def _declared_range(signal: Signal) -> tuple[float, float]:
    """Lowest and highest raw value that the database declares, infinite where it does not."""
    has_none = signal.minimum == signal.maximum == 0  # [0|0] means no range; cantools knows it, but not [0.0|0.0].
    lowest = -math.inf if has_none or signal.minimum is None else signal.minimum
    highest = math.inf if has_none or signal.maximum is None else signal.maximum
    ends = [(limit - signal.offset) / signal.scale for limit in (lowest, highest)]
    if signal.scale < 0:
        ends.reverse()
    first, last = ends if signal.conversion.is_float else map(float, np.rint(ends))
    return first, last


def _largest_value(signal: Signal, is_j1939: bool) -> int | None:
    """The largest code that is a value by J1939 and value table; None: no exclusion, or an enumeration."""
    if signal.conversion.is_float or signal.length < 8:
        return None
    largest = code = (1 << signal.length - signal.is_signed) - 1
    if is_j1939 and not signal.is_signed:
        code = (_J1939_NO_VALUE << signal.length - 8) - 1
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
    value = core.raw_value(code, row)
    if not row["lowest"] <= value <= row["highest"]:
        return code  # clamping keeps every number away from it
    mask = int(row["mask"])
    for distance in range(1, len(reserved) + 1):  # At most the other reserved code stands between.
        for candidate in ((code - distance) & mask, (code + distance) & mask):
            raw = core.raw_value(candidate, row)
            wrapped_round = row["kind"] < core.FLOAT32 and abs(raw - value) > distance
            if candidate not in reserved and not wrapped_round and row["lowest"] <= raw <= row["highest"]:
                return candidate
    raise UserError(location, "all codes within its range are reserved", "correct GenSigSNA or GenSigError")
