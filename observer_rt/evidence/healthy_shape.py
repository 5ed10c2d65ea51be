"""The shape of what a model leaves of a healthy injector: mean innovation after an opening and after a closing.

No model of a real line is exact. What it leaves of the healthy injector comes back in every injection: one course
after the needle leaves its seat, one after it is back on it, both changing with the rail pressure. With it taken out,
an injector is compared with the healthy one instead of with the model.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from observer_rt.evidence.measurement import JudgedEvent, Measurement
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.baseline import HealthyShape

KNOTS = 1e-6 * np.concatenate(
    [np.arange(-40.0, 400.0, 20.0), np.arange(400.0, 1200.0, 40.0), np.arange(1200.0, 4001.0, 100.0)]
)
"""Times [s] after an opening, or a closing, between which the course is straight; 0 before and after."""
CENTRE, SPAN = (
    100 * MEGAPASCAL,
    40 * MEGAPASCAL,
)  # of the rail pressure, with which the courses change linearly
SPREAD = 0.6  # standard deviation of a knot before anything was measured, in sigma of an innovation
_DIGITS = 5  # of MPa: 10 Pa


def expected(shape: HealthyShape, measurement: Measurement) -> NDArray[np.float64]:
    """Mean innovation [Pa] of a healthy injector at the counted samples (n,) of a recording."""
    pressure = _pressure(measurement)
    courses = [
        MEGAPASCAL * (np.array(constant) + pressure * np.array(slope))
        for constant, slope in ((shape.opening, shape.opening_slope), (shape.closing, shape.closing_slope))
    ]
    result = []
    for event in measurement.events:
        total = np.zeros(event.end - event.counted)
        for times in _times(measurement, event):
            for course, after in zip(courses, times, strict=True):
                total += np.interp(after, KNOTS, course, left=0.0, right=0.0)
        result.append(total)
    return np.concatenate(result)


def together(one: HealthyShape, other: HealthyShape) -> HealthyShape:
    """Both courses added up."""
    added = {
        name: tuple(
            round(a + b, _DIGITS) for a, b in zip(getattr(one, name), getattr(other, name), strict=True)
        )
        for name in HealthyShape.model_fields
    }
    return HealthyShape(**added)


class ShapeFit:
    """The shape that explains innovations of healthy recordings best: least squares with a prior on every knot."""

    def __init__(self, seen: Sequence[tuple[Measurement, NDArray[np.float64], float]]) -> None:
        """seen: recordings, each with its normalised innovations (n,) and their standard deviation [Pa]."""
        self._parts = [_normal_equations(measurement, z) for measurement, z, _ in seen]
        self._sigma = float(np.mean([sigma for _, _, sigma in seen]))

    def shape(self, left_out: int | None = None) -> HealthyShape:
        """By all recordings, or all but the one with this number."""
        kept = [part for number, part in enumerate(self._parts) if number != left_out]
        information = np.sum([part[0] for part in kept], axis=0)
        gradient = np.sum([part[1] for part in kept], axis=0)
        found = np.linalg.solve(information + np.eye(gradient.size) / SPREAD**2, gradient)
        courses = np.round(found.reshape(4, KNOTS.size) * self._sigma / MEGAPASCAL, _DIGITS).tolist()
        return HealthyShape(**dict(zip(HealthyShape.model_fields, courses, strict=True)))


def _normal_equations(
    measurement: Measurement, z: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Information (p, p) and gradient (p,) of the knots, opening and closing, each constant and with pressure."""
    size, pressure, begin = KNOTS.size, _pressure(measurement), 0
    information, gradient = np.zeros((4 * size, 4 * size)), np.zeros(4 * size)
    for event in measurement.events:
        end = begin + event.end - event.counted
        design = np.zeros((end - begin, 4 * size))
        for times in _times(measurement, event):
            for number, after in enumerate(times):
                hats = _hats(after)
                design[:, 2 * number * size : (2 * number + 1) * size] += hats
                design[:, (2 * number + 1) * size : (2 * number + 2) * size] += pressure * hats
        information += design.T @ design
        gradient += design.T @ z[begin:end]
        begin = end
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


def _times(
    measurement: Measurement, event: JudgedEvent
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Times [s] (n,) of an event's counted samples after each opening and its closing, where the ramps meet 0."""
    samples = np.arange(event.counted, event.end)
    for opening in event.openings:
        opens, shuts = float(opening.first), float(opening.last)
        if opening.rising.slope > 0.0:
            opens -= opening.rising.lift / opening.rising.slope
        if opening.falling.slope > 0.0:
            shuts += opening.falling.lift / opening.falling.slope
        interval = measurement.interval
        yield np.asarray(interval * (samples - opens)), np.asarray(interval * (samples - shuts))


def _pressure(measurement: Measurement) -> float:
    return (measurement.rail_pressure - CENTRE) / SPAN
