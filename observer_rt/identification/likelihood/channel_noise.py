"""Noise of lift and rail pressure on its way into the innovations: one restored, the other smoothed.

y + lag y' has the noise of the lift y several times over: 3 times for a lag of 40 us at 100 kHz. What that does to
the line pressure is no error of a model, and must not count as one.

A line in which pressure travels takes the noise of its rail pressure for pressure. What rounds that noise - a rail
pressure read between two samples, a line pressure taken for late and early at once - would explain any recording
better. So the rail pressure is smoothed first, by one kernel whatever its delay: the same noise is left of it.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.model import InputTerms
from observer_rt.identification.likelihood.measurement import Measurement

WIDTH = 50e-6  # s, of the kernel that smooths the rail pressure: it leaves what a rail does up to some 3 kHz
REACH = 4.0  # widths to either side
MOVING = 0.5  # of the noise: by so much the rail moves in events where its delay can be seen at all
DRAWS = 8  # of the lift's noise, by which a variance is found
LAG_GRID = 6e-6  # s of lag, at whose multiples it is found
AVERAGED = 15  # samples over which it is averaged

Innovations = Callable[[Measurement, float], NDArray[np.float64]]
"""Normalised innovations (n,) of a recording with a lag [s] of its lift undone."""


def smoothing_of(interval: float) -> float:
    """Width of the kernel [s] at a sample interval [s]: at least a sample, so that noise does not fix the delay."""
    return max(WIDTH, interval)


def true_rail_pressure(measurement: Measurement, delay: float) -> NDArray[np.float64]:
    """Rail pressure [Pa] (n,), smoothed, of a channel that records it `delay` [s] late.

    The kernel is of fourth order, (3 - u2)/2 times a normal density: parabolas pass as they are. A rail at rest
    during events is not moved: to move its noise is to draw another noise, which some delay always likes.
    """
    rail = measurement.recording.rail_pressure
    late, width = delay / measurement.interval, smoothing_of(measurement.interval) / measurement.interval
    if not _moves(measurement):
        late = 0.0
    available = np.isfinite(rail)
    if not available.all():  # outside of what is judged, but within the kernel's reach
        sample = np.arange(rail.size)
        rail = np.interp(sample, sample[available], rail[available])
    reach = int(np.ceil(REACH * width + abs(late)))
    u = (np.arange(-reach, reach + 1) - late) / width
    weights = (3.0 - u**2) * np.exp(-0.5 * u**2)
    beyond = np.pad(rail, reach, mode="edge")
    return np.asarray(np.convolve(beyond, weights[::-1] / weights.sum(), "valid"), np.float64)


def rail_on_time(measurement: Measurement, terms: InputTerms) -> NDArray[np.float64]:
    """Recorded rail pressure [Pa] (n,), smoothed, at the times of the other two channels."""
    half_period = 0.5 * measurement.interval if measurement.means else 0.0
    return true_rail_pressure(measurement, terms.rail_delay + half_period)


def _moves(measurement: Measurement) -> bool:
    """Whether the rail pressure moves within events."""
    rail, noise = measurement.recording.rail_pressure, measurement.noise.rail_pressure
    variance = np.mean([np.var(rail[event.start : event.end]) for event in measurement.events])
    return bool(variance > (1.0 + MOVING**2) * noise**2)


class LiftNoise:
    """Variance that the noise of the lift adds to the normalised innovations of a recording, by the lag."""

    def __init__(self, measurement: Measurement, innovations: Innovations) -> None:
        self._measurement = measurement
        self._innovations = innovations
        self._cache: dict[int, NDArray[np.float64]] = {}

    def variance(self, lag: float) -> NDArray[np.float64]:
        """(n,): beyond that without a lag [s]; straight between multiples of `LAG_GRID`: a fit meets no step."""
        below = math.floor(lag / LAG_GRID)
        share = lag / LAG_GRID - below
        added = (1.0 - share) * self._at(below) + share * self._at(below + 1)
        return np.asarray(np.maximum(added - self._at(0), 0.0))

    def _at(self, multiple: int) -> NDArray[np.float64]:
        if multiple not in self._cache:
            self._cache[multiple] = self._estimate(multiple * LAG_GRID)
        return self._cache[multiple]

    def _estimate(self, lag: float) -> NDArray[np.float64]:
        measurement, rng = self._measurement, np.random.default_rng(0)
        recording = measurement.recording
        undisturbed = self._innovations(measurement, lag)
        squares = np.zeros(undisturbed.size)
        for _ in range(DRAWS):
            noise = rng.normal(0.0, measurement.noise.needle_lift, recording.samples)
            louder = replace(recording, needle_lift=recording.needle_lift + noise)
            squares += (self._innovations(replace(measurement, recording=louder), lag) - undisturbed) ** 2
        mean = np.convolve(squares / DRAWS, np.full(AVERAGED, 1.0 / AVERAGED), mode="same")
        return np.where(np.isfinite(mean), mean, 0.0)
