"""Interval arithmetic of a law's operations: values and slopes lie between its ends, but for rounding."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from observer_rt.core.model.model import Operation
from observer_rt.foundation.units import Floats

SAME, _RIGHT = np.zeros((2, 1)), 0.5 * np.pi
_FUNCTIONS: Mapping[Operation, Callable[[Floats, Floats], tuple[Floats, Floats]]] = {
    Operation.NEGATE: lambda ends, size: (-ends[::-1], SAME - 1.0),
    Operation.ABS: lambda ends, size: (size, np.where([ends[0] < 0.0, ends[1] <= 0.0], -1.0, 1.0)),
    Operation.SQRT: lambda ends, size: (np.copysign(np.sqrt(np.abs(ends)), ends), 0.5 / np.sqrt(size[::-1])),
    Operation.EXP: lambda ends, size: (np.exp(ends), np.exp(ends)),
    Operation.LOG: lambda ends, size: (np.log(ends), 1.0 / ends[::-1]),
    Operation.TANH: lambda ends, size: (np.tanh(ends), 1.0 - np.tanh(size[::-1]) ** 2),
    Operation.SIN: lambda ends, size: (_sine(ends), _sine(ends + _RIGHT)),
    Operation.COS: lambda ends, size: (_sine(ends + _RIGHT), _sine(ends + 2.0 * _RIGHT)),
}
"""Ends of values, and of slopes, by ends of the argument and of its size."""


class Enclosure(NamedTuple):
    """Ends (2, n) of values, nan where a value may be undefined, and of slopes by a variable, 0 at a jump."""

    values: Floats
    slopes: Floats = SAME


def enclosed(operation: Operation, first: Enclosure, *others: Enclosure) -> Enclosure:
    """The result of an operation on one or two arguments."""
    for second in others:
        match operation:
            case Operation.ADD:
                return Enclosure(first.values + second.values, first.slopes + second.slopes)
            case Operation.SUBTRACT:
                return enclosed(Operation.ADD, first, enclosed(Operation.NEGATE, second))
            case Operation.MULTIPLY:
                values = _hull(*(one * other for one in first.values for other in second.values))
                return Enclosure(values, _steep(first.values, second.slopes) + _steep(second.values, first.slopes))
            case Operation.DIVIDE:
                inverse = _raised(second, -1.0)
                shares = _hull(*(one / other for one in first.values for other in second.values))
                slopes = enclosed(Operation.MULTIPLY, first, inverse).slopes
                return Enclosure(np.where(np.isnan(inverse.values), np.nan, shares), slopes)
            case Operation.POWER:
                return _raised(first, float(second.values[0, 0]))
            case Operation.LESS:
                return enclosed(Operation.GREATER, second, first)
            case Operation.GREATER:
                (low, high), (least, most) = first.values, second.values
                return Enclosure(np.where([low > most, ~(high <= least)], 1.0, 0.0))
            case Operation.MAX:
                negative = (enclosed(Operation.NEGATE, each) for each in (first, second))
                return enclosed(Operation.NEGATE, enclosed(Operation.MIN, *negative))
        (low, high), (least, most), (rise, further) = first.values, second.values, (first.slopes, second.slopes)
        both = np.array([np.minimum(rise[0], further[0]), np.maximum(rise[1], further[1])])
        slopes = np.where(high <= least, rise, np.where(most <= low, further, both))
        return Enclosure(np.minimum(first.values, second.values), slopes)
    values, rises = _FUNCTIONS[operation](first.values, size_of(first.values))
    return Enclosure(values, _steep(rises, first.slopes))


def _raised(base: Enclosure, power: float) -> Enclosure:
    values, slopes = enclosed(Operation.ABS, base) if power % 2.0 == 0.0 else base
    rises = _steep(SAME + power, _hull(*size_of(values) ** (power - 1.0)))
    undefined = (values[0] <= 0.0) & (values[1] >= 0.0) & (values[0] < values[1]) & (power < 0.0)
    return Enclosure(np.where(undefined, np.nan, _hull(*values**power)), _steep(rises, slopes))


def _hull(*values: Floats) -> Floats:
    """Ends (2, n) of what may be any of several values (n,)."""
    return np.array([np.minimum.reduce(values), np.maximum.reduce(values)])


def size_of(ends: Floats) -> Floats:
    """Ends (2, n) of the size of what lies between ends."""
    return np.array([np.maximum(np.maximum(ends[0], -ends[1]), 0.0), np.maximum(-ends[0], ends[1])])


def _sine(ends: Floats) -> Floats:
    middle, half = np.sin(0.5 * (ends[0] + ends[1])), 0.5 * (ends[1] - ends[0])
    return np.asarray(np.clip([middle - half, middle + half], -1.0, 1.0))


def _steep(factor: Floats, slopes: Floats) -> Floats:
    """Slopes times a factor: none where either is 0, however large the other."""
    if not slopes.any():
        return SAME
    both = [(one, other) for one in factor for other in slopes]
    return _hull(*(np.where((one == 0.0) | (other == 0.0), 0.0, one * other) for one, other in both))
