"""Maximum likelihood within bounds: Levenberg-Marquardt on normalised residuals by finite differences."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from observer_rt.core.learning.whitening import HUBER, robust_cost
from observer_rt.foundation.units import Floats, Ints

MAX_ITERATIONS = 15
MAX_TRIALS = 8  # of ever shorter steps in one iteration
TOLERANCE = 0.02  # of the expected and the achieved decrease of -2 log L
FIRST_DAMPING = 1e-3
MORE_DAMPING, LESS_DAMPING = 8.0, 0.1
BLIND = 1e-7  # of a correlation's largest eigenvalue: 6e-10 if two do the same, 3e-5 if pressures tell little
_ONE_THREAD_PRODUCTS = 200_000  # multiplications that BLAS does in one thread
NORMAL_975 = 1.959964  # quantile of the normal distribution, of a 95 % interval


@dataclass(frozen=True, eq=False)
class Residuals:
    """Normalised residuals of a model on all recordings."""

    z: Floats  # (n,) in groups, one after another
    counts: Ints  # (groups,) how many
    log_sigma: Floats  # (groups,) logarithm of the standard deviation they were divided by

    @classmethod
    def of(cls, groups: Sequence[tuple[Floats, float]]) -> Self:
        """Groups of residuals (n,), each with its log_sigma, as one."""
        sizes = np.array([z.size for z, _ in groups])
        return cls(np.concatenate([z for z, _ in groups]), sizes, np.array([log_sigma for _, log_sigma in groups]))

    @property
    def statistic(self) -> float:
        """-2 log L of a Gaussian model, robust beyond HUBER sigma, constants left out."""
        return float(self.squares + 2.0 * (self.counts @ self.log_sigma))

    @property
    def squares(self) -> float:
        """Sum of squares, linear beyond HUBER sigma: what `statistic` counts of them."""
        return 2.0 * float(robust_cost(self.z, 0, 1.0))

    @property
    def roots(self) -> Floats:
        """Roots (n,) of the weights that make least squares of `statistic` round here."""
        return np.asarray(np.sqrt(np.minimum(1.0, HUBER / np.maximum(np.abs(self.z), HUBER))))

    @property
    def spread(self) -> float:
        """Mean square of the residuals as `statistic` counts it, 1 at least."""
        return max(1.0, self.squares / self.z.size)


Problem = Callable[[Floats], Residuals | None]
"""Residuals as a function of parameters theta (p,); None where the model has no solution."""


@dataclass(frozen=True)
class Range:
    """Bounds of one parameter and the step of its finite difference."""

    lowest: float
    highest: float
    step: float


@dataclass(frozen=True, eq=False)
class Quadratic:
    """-2 log L round theta (p,), to second order."""

    theta: Floats
    residuals: Residuals
    statistic: float
    gradient: Floats  # (p,) half of it
    information: Floats  # (p, p) of Fisher
    slopes: Floats  # (n, p) dz/dtheta with sigma held, weighted


def linearise(problem: Problem, theta: Floats, here: Residuals, ranges: Sequence[Range]) -> Quadratic:
    """Slopes by one-sided differences, inwards where a bound is near or the model has no solution on the other side.

    With z = e/sigma, -log L = sum rho(z) + log sigma has the Fisher information z'z' (sigma held) + 2 (log sigma)'^2.
    """
    p = theta.size
    roots = here.roots
    weighted = roots**2 * here.z
    slopes = np.zeros((here.z.size, p), order="F")  # filled by columns
    spreads = np.zeros((here.counts.size, p))
    gradient, unit = np.zeros(p), np.eye(p)
    for j, bounds in enumerate(ranges):
        step = bounds.step if theta[j] + bounds.step <= bounds.highest else -bounds.step
        moved = problem(theta + step * unit[j])
        if moved is None and theta[j] - step >= bounds.lowest:
            step = -step
            moved = problem(theta + step * unit[j])
        if moved is None:
            continue
        slope = (moved.z - here.z) / step
        spreads[:, j] = (moved.log_sigma - here.log_sigma) / step
        gradient[j] = float(np.sum(weighted * slope) + here.counts @ spreads[:, j])
        if spreads[:, j].any():
            slope += here.z * np.repeat(spreads[:, j], here.counts)
        np.multiply(roots, slope, out=slopes[:, j])
    information = _squares(slopes) + 2.0 * (spreads.T * here.counts) @ spreads
    return Quadratic(theta, here, here.statistic, gradient, information, slopes)


def _squares(slopes: Floats) -> Floats:
    """slopes.T @ slopes (p, p), in blocks so small that BLAS starts no threads, which would wait more than work."""
    p = slopes.shape[1]
    rows = max(1, _ONE_THREAD_PRODUCTS // max(1, p * p))
    total = np.zeros((p, p))
    for first in range(0, slopes.shape[0], rows):
        block = slopes[first : first + rows]
        total += block.T @ block
    return total


@dataclass(frozen=True, eq=False)
class Minimum:
    """Minimum of a problem at which the search ended: theta (p,) and the residuals there."""

    theta: Floats
    residuals: Residuals
    stuck: bool  # whether no step along the slopes was short enough to lower -2 log L, as beside a kink
    problem: Problem
    ranges: Sequence[Range]
    expansion: Quadratic | None = None

    @cached_property
    def at(self) -> Quadratic:
        """The linearisation at the minimum: that of the search, else made at the first use."""
        return self.expansion or linearise(self.problem, self.theta, self.residuals, self.ranges)

    @property
    def statistic(self) -> float:
        """-2 log L at the minimum."""
        return self.residuals.statistic

    def sigmas(self) -> Floats:
        """Standard deviations of the parameters (p,), inf where the data say nothing."""
        return sigmas_of(self.at.information)


def fit(
    problem: Problem,
    start: Floats,
    ranges: Sequence[Range],
    max_iterations: int = MAX_ITERATIONS,
    at_start: Residuals | None = None,
) -> Minimum | None:
    """Minimise -2 log L from `start` (p,); None without a solution there. at_start: its residuals, if known."""
    theta = np.clip(start, [r.lowest for r in ranges], [r.highest for r in ranges])
    is_start = at_start is not None and np.array_equal(theta, start)
    residuals = at_start if is_start else problem(theta)
    if residuals is None:
        return None
    damping = FIRST_DAMPING
    for _ in range(max_iterations):
        here = linearise(problem, theta, residuals, ranges)
        lower, damping = _lower(problem, here, ranges, damping)
        if lower is None:
            return Minimum(here.theta, here.residuals, math.isinf(damping), problem, ranges, here)
        theta, residuals = lower
        if here.statistic - residuals.statistic < TOLERANCE:
            break
    return Minimum(theta, residuals, False, problem, ranges)


def sigmas_of(information: Floats) -> Floats:
    """Standard deviations of parameters (p,) by their information (p, p); inf if open, of two that do the same."""
    seen = np.flatnonzero(np.diag(information) > 0.0)
    variances = np.full(len(information), np.inf)
    if seen.size:
        scale = 1.0 / np.sqrt(np.diag(information)[seen])
        values, vectors = np.linalg.eigh(information[np.ix_(seen, seen)] * np.outer(scale, scale))
        is_told, shares = values > BLIND * values[-1], vectors**2
        by_told = shares[:, is_told] @ (1.0 / values[is_told])
        is_open = (shares[:, ~is_told] > BLIND).any(axis=1)
        variances[seen] = np.where(is_open, np.inf, by_told * scale**2)
    return np.asarray(np.sqrt(variances))


def _lower(
    problem: Problem, here: Quadratic, ranges: Sequence[Range], damping: float
) -> tuple[tuple[Floats, Residuals] | None, float]:
    """A lower point, None where none is expected, and the next damping: inf where no step was short enough."""
    lowest = np.array([r.lowest for r in ranges])
    highest = np.array([r.highest for r in ranges])
    outwards = ((here.theta <= lowest) & (here.gradient > 0.0)) | ((here.theta >= highest) & (here.gradient < 0.0))
    diagonal = np.diag(here.information)
    free = np.flatnonzero(~outwards & (diagonal > 0.0))
    if free.size == 0:
        return None, damping
    information = here.information[np.ix_(free, free)]
    for _ in range(MAX_TRIALS):
        damped = information + damping * np.diag(diagonal[free])
        theta = here.theta.copy()
        theta[free] -= np.linalg.solve(damped, here.gradient[free])
        clipped = np.clip(theta, lowest, highest)
        move = clipped - here.theta
        expected = -float(2.0 * here.gradient @ move + move @ here.information @ move)
        if expected < TOLERANCE:
            if np.array_equal(clipped, theta):
                return None, damping
            damping *= MORE_DAMPING  # a bound bends the step: a shorter one may stay inside
            continue
        theta = clipped
        trial = problem(theta)
        if trial is not None and math.isfinite(trial.statistic) and trial.statistic < here.statistic:
            return (theta, trial), damping * LESS_DAMPING
        damping *= MORE_DAMPING
    return None, math.inf
