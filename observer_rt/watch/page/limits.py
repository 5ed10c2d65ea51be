"""Ends of an axis that stay as long as they can: an axis that moves cannot be read, and is dear to draw."""

import math
from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from observer_rt.watch.injection import Signal

Limits: TypeAlias = tuple[float, float]
_WIDEST = 3.0  # times what is to be seen


class Axis:
    """Of some columns; at least `span` long, so that noise looks like noise.

    margin: beside what is to be seen, as a share of it.
    """

    def __init__(self, columns: Sequence[str], span: float, margin: float = 0.04) -> None:
        self._columns = columns
        self._span = span
        self._margin = margin
        self._limits: Limits = (0.0, span)

    def limits(self, columns: Mapping[str, Signal]) -> Limits:
        """Its ends for what is to be seen: those it has where they will do, else round ones."""
        found = np.concatenate([columns[name] for name in self._columns])
        found = found[np.isfinite(found)]
        if found.size:
            low, high = float(found.min()), float(found.max())
            beside = self._margin * (high - low)
            self._limits = round_limits(low - beside, high + beside, self._span, self._limits)
        return self._limits


def round_limits(low: float, high: float, span: float, before: Limits) -> Limits:
    """Round ends around values from low to high, at least `span` apart; those before where they are not too wide."""
    needed = max(high - low, span)
    if before[0] <= low and high <= before[1] and span <= before[1] - before[0] <= _WIDEST * needed:
        return before
    step = 10.0 ** math.floor(math.log10(needed)) / 2.0
    middle = 0.5 * (low + high)
    first = math.floor(min(low, middle - 0.5 * span) / step)
    last = math.ceil(max(high, middle + 0.5 * span) / step)
    return first * step, last * step
