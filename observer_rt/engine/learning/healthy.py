"""What a fitted model leaves of a healthy injector, and its shape: observer and `discover` do not object to it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.healthy_course import KNOTS, EventStretch
from observer_rt.engine.estimation.phases import BLOCKS, PHASES, Phase, PhaseStatistics
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.baseline import Appearance, Baseline, HealthyRemainder, HealthyShape, PhaseFigures, Remainder

SPREAD = 0.6  # standard deviation of a knot before anything was measured, in sigma of an innovation
_DIGITS = 5  # of MPa: 10 Pa
EDGES = (Phase.OPENING, Phase.CLOSING)
# Mean square of single samples at an edge that a fitted model may leave: where the lift has a corner between two
# samples, the flow scatters, and more so in injections that were not fitted. A biased mass shows in means of blocks.
SCATTER = 2.0
_FOR_NAMING = ("shape", "appears", "line_pressure_offset_MPa")
SAME_RATE = 0.01  # share by which sample rates may differ and a baseline still holds: blocks count samples


def together(first: HealthyShape, second: HealthyShape) -> HealthyShape:
    """Both courses added up."""
    added = {
        name: tuple(round(a + b, _DIGITS) for a, b in zip(getattr(first, name), getattr(second, name), strict=True))
        for name in HealthyShape.model_fields
    }
    return HealthyShape(**added)


Seen = Sequence[tuple[EventStretch, NDArray[np.float64]]]
"""Events with their normalised innovations (n,)."""


class ShapeFit:
    """The shape that explains innovations of healthy recordings best: least squares with a prior on every knot."""

    def __init__(self, recordings: Sequence[Seen], sigma: float) -> None:
        """recordings: the events of each; sigma: standard deviation of an innovation [Pa]."""
        self._parts = [_normal_equations(seen) for seen in recordings]
        self._sigma = sigma

    def shape(self, left_out: int | None = None) -> HealthyShape:
        """Fits the shape to all recordings, or to all but the one with this number."""
        kept = [part for number, part in enumerate(self._parts) if number != left_out]
        information = np.sum([part[0] for part in kept], axis=0)
        gradient = np.sum([part[1] for part in kept], axis=0)
        solution = np.linalg.solve(information + np.eye(gradient.size) / SPREAD**2, gradient)
        courses = np.round(solution.reshape(4, KNOTS.size) * self._sigma / MEGAPASCAL, _DIGITS).tolist()
        return HealthyShape(**dict(zip(HealthyShape.model_fields, courses, strict=True)))


def _normal_equations(seen: Seen) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Information (p, p) and gradient (p,) of the knots, opening and closing, each constant and with pressure."""
    size = KNOTS.size
    information, gradient = np.zeros((4 * size, 4 * size)), np.zeros(4 * size)
    for stretch, z in seen:
        design = np.zeros((stretch.samples, 4 * size))
        for edges in stretch.openings:
            for number, edge in enumerate(edges):
                hats = _hats(stretch.times(edge))
                design[:, 2 * number * size : (2 * number + 1) * size] += hats
                design[:, (2 * number + 1) * size : (2 * number + 2) * size] += stretch.pressure * hats
        information += design.T @ design
        gradient += design.T @ z
    return information, gradient


def _hats(after: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights of the knots (n, knots) of a course that is straight between them, at times (n,) [s]."""
    result = np.zeros((after.size, KNOTS.size))
    rows = np.flatnonzero((after >= KNOTS[0]) & (after < KNOTS[-1]))
    before = np.searchsorted(KNOTS, after[rows], "right") - 1
    share = (after[rows] - KNOTS[before]) / (KNOTS[before + 1] - KNOTS[before])
    result[rows, before] = 1.0 - share
    result[rows, before + 1] = share
    return result


@dataclass(frozen=True, eq=False)
class Healthy:
    """Innovations of the healthy injector; by default those of an exact model: white, and no event scatters more."""

    variance: NDArray[np.float64] = field(default_factory=lambda: np.ones(PHASES))  # at least 1, without the shape
    colour: NDArray[np.float64] = field(default_factory=lambda: np.ones((PHASES, len(BLOCKS))))  # the same, of blocks
    mass_share: float = 0.0  # standard deviation of a mass, as a share, by the model
    adequate: bool = True  # whether the fitted model may be learned, or named, with at all
    live_variance: float = 1.0  # largest variance of a phase with the shape in it
    shape: HealthyShape | None = None  # mean course; None: 0
    overdispersion: float = 1.0  # factor by which events scatter beyond noise
    appears: Mapping[str, Appearance] = field(default_factory=dict)  # effects it seems to have; for `discover`
    line_pressure_offset_MPa: float = 0.0  # noqa: N815 - as in [baseline]; for `discover`
    rate: PhaseStatistics | None = None  # innovations of a measured injection rate; for `discover`
    seen: tuple[float, float] = (-math.inf, math.inf)  # line pressures [Pa] at which laws in force were seen

    def relative(self, statistics: PhaseStatistics) -> PhaseStatistics:
        """Statistics of an event relative to those of the healthy injector."""
        return statistics.relative_to(self.variance, self.colour)


NOT_FITTED = Healthy()
"""Remainder of a model that was not fitted to recordings."""


def healthy_of(baseline: Baseline | None, sample_rate: float, trusted: bool = False) -> Healthy:
    """Healthy injector of a fitted file at a sample rate [Hz]; trusted: learn even if its model is inadequate."""
    if baseline is None:
        return NOT_FITTED
    share, adequate = baseline.mass_share, baseline.adequate or trusted
    if not is_same_rate(baseline.sample_rate_Hz, sample_rate):
        return Healthy(mass_share=share, adequate=adequate)
    observer, live_variance = baseline.observer, float(_with_scatter(baseline.variance).max())
    if observer is None:
        colour = at_least_noise(baseline.chi2, baseline.colour)
        return Healthy(_with_scatter(baseline.variance), colour, share, adequate, live_variance)
    return Healthy(
        _with_scatter(observer.variance),
        at_least_noise(observer.colour, observer.colour),
        share,
        adequate,
        live_variance,
        observer.shape,
        observer.overdispersion,
    )


def with_remainder(healthy: Healthy, remainder: Remainder | None, sample_rate: float) -> Healthy:
    """Healthy injector whose accepted terms leave a remainder, too; None: they leave none. sample_rate: [Hz].

    Uncertainties of masses add in quadrature; of innovations the larger limit of the two holds.
    """
    if remainder is None:
        return healthy
    widened = replace(healthy, mass_share=math.hypot(healthy.mass_share, remainder.mass_share))
    left = remainder.observer
    if left is None or not is_same_rate(remainder.sample_rate_Hz, sample_rate):
        return widened
    live_variance = float(_with_scatter(remainder.variance).max())
    return replace(
        widened,
        variance=np.maximum(healthy.variance, _with_scatter(left.variance)),
        colour=np.maximum(healthy.colour, at_least_noise(left.colour, left.colour)),
        live_variance=max(healthy.live_variance, live_variance),
        shape=left.shape,  # of all that the model leaves
        overdispersion=max(healthy.overdispersion, left.overdispersion),
    )


def healthy_for_naming(
    left: Baseline | HealthyRemainder, adequate: bool, rate: PhaseStatistics | None = None
) -> Healthy:
    """Healthy injector for `discover`; a `Baseline` gives variance and colour only.

    adequate: whether the model explains the healthy injector; rate: innovations of its measured rate.
    """
    kept_fields = {} if isinstance(left, Baseline) else {name: getattr(left, name) for name in _FOR_NAMING}
    variance, colour = at_least_noise(left.variance)[:, 0], at_least_noise(left.colour, left.colour)
    return Healthy(variance, colour, adequate=adequate, rate=rate, **kept_fields)


def at_least_noise(*figures: PhaseFigures) -> NDArray[np.float64]:
    """Mean squares (PHASES, len(figures)), none below that of noise alone."""
    return np.maximum([[each.at(phase.name) for each in figures] for phase in Phase], 1.0)


def _with_scatter(left: PhaseFigures) -> NDArray[np.float64]:
    variance = at_least_noise(left)[:, 0]
    variance[list(EDGES)] = np.maximum(variance[list(EDGES)], SCATTER)
    return variance


def is_same_rate(first: float, second: float) -> bool:
    """Whether blocks of innovations at two sample rates [Hz] span the same time."""
    return math.isclose(first, second, rel_tol=SAME_RATE)
