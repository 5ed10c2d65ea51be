"""Scores of explanations: the gain of each beside a model, from one linearisation."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.units import Floats, Ints
from observer_rt.identification.likelihood.bounded_fit import Residuals
from observer_rt.model.effect import Effect

SWITCH_SIZE = 1.0  # size of a switch
WeightedSlopes = NDArray[np.float32]
"""Change of residuals by a size, in proportion to it, times the roots of their weights."""


@dataclass(frozen=True, eq=False)
class Scores:
    """Slopes of the n residuals of a model by the sizes of m effects, and the gain of each effect alone."""

    effects: tuple[Effect, ...]
    numbers: Ints  # (m,) of the effects among those tried
    information_of: Floats  # (parts, m, m) of every part of the data
    gradient_of: Floats  # (parts, m) half the fall of -2 log L
    slopes: WeightedSlopes  # (n, m)
    left: float  # weighted sum of squares of the residuals

    @cached_property
    def information(self) -> Floats:
        """Information of all data (m, m)."""
        return np.asarray(self.information_of.sum(axis=0))

    @cached_property
    def gradient(self) -> Floats:
        """Gradient of all data (m,)."""
        return np.asarray(self.gradient_of.sum(axis=0))

    @cached_property
    def gains(self) -> Floats:
        """Gains of -2 log L (m,) by sizes within their bounds."""
        own = np.diag(self.information)
        sizes = self._within_bounds(self.gradient / own)
        return np.asarray(2.0 * sizes * self.gradient - sizes**2 * own)

    @cached_property
    def validated(self) -> Floats:
        """Gains (m,) of every part of the data by the sizes that the other parts give."""
        own, total = np.diagonal(self.information_of, axis1=1, axis2=2), np.diag(self.information)
        sizes = self._within_bounds((self.gradient - self.gradient_of) / np.maximum(total - own, 1e-12 * total))
        return np.asarray(np.sum(2.0 * sizes * self.gradient_of - sizes**2 * own, axis=0))

    def _within_bounds(self, sizes: Floats) -> Floats:
        lowest, highest = np.array([bounds_of(one) for one in self.effects]).reshape(-1, 2).T
        return np.clip(sizes, lowest, highest)

    def cosine(self, first: int, second: int) -> float:
        """Cosine of the slopes in two rows."""
        length = math.sqrt(self.information[first, first] * self.information[second, second])
        return abs(float(self.information[first, second])) / length

    def part(self, tried: range) -> "Scores":
        """Scores of the effects with these numbers, counted from the first; one without a slope is missing."""
        rows = np.flatnonzero((self.numbers >= tried.start) & (self.numbers < tried.stop))
        effects, numbers = tuple(self.effects[row] for row in rows), self.numbers[rows] - tried.start
        information, gradient = self.information_of[:, rows[:, None], rows], self.gradient_of[:, rows]
        return Scores(effects, numbers, information, gradient, self.slopes[:, rows], self.left)

    def sizes(self, rows: Sequence[int]) -> Floats:
        """Sizes (k,) of several rows together."""
        information = self.information[np.ix_(rows, rows)]
        return np.asarray(np.linalg.lstsq(information, self.gradient[list(rows)], rcond=1e-9)[0])


def bounds_of(effect: Effect) -> tuple[float, float]:
    """Bounds of an effect's first parameter; of a switch, 0 and 1."""
    return (effect.parameters[0].lowest, effect.parameters[0].highest) if effect.parameters else (0.0, SWITCH_SIZE)


def scored(effects: Sequence[Effect], numbers: Ints, slopes: WeightedSlopes, here: Residuals) -> Scores:
    """Scores of effects (m,) by the slopes (n, m) of the residuals. numbers: as of `Scores`."""
    left = np.asarray(here.roots * here.z, np.float32)
    ends = np.cumsum(here.counts)
    parts = [slice(int(end - count), int(end)) for end, count in zip(ends, here.counts, strict=True) if count]
    information = np.array([slopes[part].T @ slopes[part] for part in parts], np.float64)
    gradient = np.array([slopes[part].T @ left[part] for part in parts], np.float64)
    return Scores(tuple(effects), numbers, information, gradient, slopes, float(np.sum(left**2, dtype=np.float64)))
