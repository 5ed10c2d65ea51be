"""The shape of what a model leaves of a healthy injector: mean innovation after an opening and after a closing.

No model of a real line is exact. What it leaves of the healthy injector comes back in every injection: one course
after the needle leaves its seat, one after it is back on it, both changing with the rail pressure. With it taken out,
an injector is compared with the healthy one instead of with the model.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.baseline import HealthyShape

KNOTS = 1e-6 * np.concatenate(
    [np.arange(-40.0, 400.0, 20.0), np.arange(400.0, 1200.0, 40.0), np.arange(1200.0, 4001.0, 100.0)]
)
"""Times [s] after an opening, or a closing, between which the course is straight; 0 before and after."""
# Of the rail pressure, with which the courses change linearly.
CENTRE, SPAN = 100 * MEGAPASCAL, 40 * MEGAPASCAL
SPREAD = 0.6  # standard deviation of a knot before anything was measured, in sigma of an innovation
_DIGITS = 5  # of MPa: 10 Pa


class EventStretch(NamedTuple):
    """Consecutive samples round one event, so many of an interval [s]; rail_pressure [Pa] before it.

    openings: where the needle leaves its seat and where it is back on it, in samples from the first one, with
    fractions.
    """

    samples: int
    interval: float
    rail_pressure: float
    openings: tuple[tuple[float, float], ...]

    @property
    def pressure(self) -> float:
        """Rail pressure in the unit by which courses change."""
        return (self.rail_pressure - CENTRE) / SPAN

    def times(self, at: float) -> NDArray[np.float64]:
        """Times [s] (n,) of the samples after a position."""
        return np.asarray(self.interval * (np.arange(self.samples) - at), np.float64)


def expected(shape: HealthyShape, stretch: EventStretch) -> NDArray[np.float64]:
    """Mean innovation [Pa] (n,) of a healthy injector over a stretch."""
    courses = [
        MEGAPASCAL * (np.array(constant) + stretch.pressure * np.array(slope))
        for constant, slope in ((shape.opening, shape.opening_slope), (shape.closing, shape.closing_slope))
    ]
    total = np.zeros(stretch.samples)
    for edges in stretch.openings:
        for course, edge in zip(courses, edges, strict=True):
            total += np.interp(stretch.times(edge), KNOTS, course, left=0.0, right=0.0)
    return total


def together(first: HealthyShape, second: HealthyShape) -> HealthyShape:
    """Both courses added up."""
    added = {
        name: tuple(
            round(a + b, _DIGITS) for a, b in zip(getattr(first, name), getattr(second, name), strict=True)
        )
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
