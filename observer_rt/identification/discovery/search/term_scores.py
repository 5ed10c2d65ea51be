"""Scores of candidate terms: from one linearisation each, what every one alone would gain."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.whitening import HUBER
from observer_rt.identification.discovery.search.term_fit import Each, TermFit, TermProblem
from observer_rt.identification.likelihood.bounded_fit import Residuals


@dataclass(frozen=True, eq=False)
class Scores:
    """Signatures of candidates in the residuals about a model, and what each alone would gain.

    numbers: (m,) of the candidates; information_of, gradient_of: (parts, m, m) and (parts, m) of every part of the
    data, the gradient half of that of -2 log L, downwards; gains: (m,) of -2 log L, sizes limited by bounds;
    validated: (m,) the same with every part of the data left out in turn; slopes: (n, m) the signatures;
    left: weighted sum of squares of the residuals.
    """

    numbers: NDArray[np.int64]
    information_of: NDArray[np.float64]
    gradient_of: NDArray[np.float64]
    gains: NDArray[np.float64]
    validated: NDArray[np.float64]
    slopes: NDArray[np.float32]
    left: float

    @cached_property
    def information(self) -> NDArray[np.float64]:
        """Of all data (m, m)."""
        return np.asarray(self.information_of.sum(axis=0))

    @cached_property
    def gradient(self) -> NDArray[np.float64]:
        """Of all data (m,)."""
        return np.asarray(self.gradient_of.sum(axis=0))

    def cosine(self, one: int, other: int) -> float:
        """Cosine of the signatures in two rows."""
        length = math.sqrt(self.information[one, one] * self.information[other, other])
        return abs(float(self.information[one, other])) / length

    def part(self, numbers: range) -> "Scores":
        """Those of some candidates, their numbers counted from the first; what has no signature is not there."""
        rows = np.flatnonzero((self.numbers >= numbers.start) & (self.numbers < numbers.stop))
        return Scores(
            self.numbers[rows] - numbers.start,
            self.information_of[:, rows[:, None], rows],
            self.gradient_of[:, rows],
            self.gains[rows],
            self.validated[rows],
            self.slopes[:, rows],
            self.left,
        )

    def pair_gain(self, one: int, other: int) -> float:
        """Gain of two rows together."""
        rows = [one, other]
        information, gradient = self.information[np.ix_(rows, rows)], self.gradient[rows]
        return float(gradient @ np.linalg.lstsq(information, gradient, rcond=1e-9)[0])


def scores_of(problem: TermProblem, about: TermFit, each: Each, among: Sequence[int] | None = None) -> Scores:
    """Scores of candidates, of all without `among`, that are not in force, one small coefficient each about a fit."""
    here = about.residuals
    tried = range(len(problem.candidates)) if among is None else among
    free = [number for number in tried if number not in about.chosen]
    weights = _weights(here)

    def signature(number: int) -> NDArray[np.float32] | None:
        bounds = problem.candidates[number].range
        for step in (bounds.step, -bounds.step):
            if bounds.lowest <= step <= bounds.highest:
                there = problem.residuals((*about.chosen, number), np.append(about.theta, step))
                if there is not None:
                    return np.asarray(weights * (here.z - there.z) / step, np.float32)
        return None

    found = [
        (number, one)
        for number, one in zip(free, each(signature, free), strict=True)
        if isinstance(one, np.ndarray) and one.any()
    ]
    numbers = np.array([number for number, _ in found], np.int64)
    slopes = np.column_stack([one for _, one in found]) if found else np.zeros((here.z.size, 0), np.float32)
    return scored(problem, numbers, slopes, here)


def _weights(here: Residuals) -> NDArray[np.float64]:
    """Roots of what residuals count (n,)."""
    return np.sqrt(np.minimum(1.0, HUBER / np.maximum(np.abs(here.z), HUBER)))


def scored(
    problem: TermProblem, numbers: NDArray[np.int64], slopes: NDArray[np.float32], here: Residuals
) -> Scores:
    """Scores of candidates (m,) by their signatures (n, m) in what is left."""
    left = np.asarray(_weights(here) * here.z, np.float32)
    ends = np.cumsum(here.counts)
    parts = [slice(int(end - count), int(end)) for end, count in zip(ends, here.counts, strict=True) if count]
    information = np.array([slopes[part].T @ slopes[part] for part in parts], np.float64)
    gradient = np.array([slopes[part].T @ left[part] for part in parts], np.float64)
    own = np.diagonal(information, axis1=1, axis2=2)
    whole, total = own.sum(axis=0), gradient.sum(axis=0)
    ranges = [problem.candidates[number].range for number in numbers]
    lowest, highest = np.array([r.lowest for r in ranges]), np.array([r.highest for r in ranges])
    sizes = np.clip(total / whole, lowest, highest)
    without = np.maximum(whole - own, 1e-12 * whole)
    validated = np.clip((total - gradient) / without, lowest, highest)
    return Scores(
        numbers,
        information,
        gradient,
        2.0 * sizes * total - sizes**2 * whole,
        np.sum(2.0 * validated * gradient - validated**2 * own, axis=0),
        slopes,
        float(np.sum(left**2, dtype=np.float64)),
    )
