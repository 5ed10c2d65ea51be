"""Noise of lift and rail pressure on its way into the innovations: of a restored lift and a smoothed rail pressure.

A lift y whose lag is undone, y + lag y', has the noise of y several times over: 3 times for 40 us at 100 kHz. The
line pressure that this noise makes is no error of a model, and must not count as one.

In a line in which pressure travels, the noise of the rail pressure travels, too. A delay by a part of a sample rounds
this noise, and would explain any recording better. So the rail pressure is smoothed first, by one kernel for every
delay: the same noise is left of it.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.model import InputTerms
from observer_rt.identification.likelihood.measurement import Measurement

SMOOTHING_WIDTH = 50e-6  # s, of the rail pressure's kernel: it leaves what a rail does up to some 3 kHz
KERNEL_REACH = 4.0  # widths to either side
MOVING_SHARE = 0.5  # of the noise: by so much the rail moves in events where its delay can be seen at all
NOISE_DRAWS = 8  # of the lift's noise, by which a variance is found
LAG_GRID = 6e-6  # s of lag, at whose multiples it is found
AVERAGED_SAMPLES = 15  # samples over which it is averaged

Innovations = Callable[[Measurement, float], NDArray[np.float64]]
"""Normalised innovations (n,) of a recording with a lag [s] of its lift undone."""


def smoothing_of(interval: float) -> float:
    """Width of the kernel [s] at a sample interval [s]: at least a sample, so that noise does not fix the delay."""
    return max(SMOOTHING_WIDTH, interval)


def true_rail_pressure(measurement: Measurement, delay: float) -> NDArray[np.float64]:
    """Rail pressure [Pa] (n,), smoothed, of a channel that records it `delay` [s] late.

    The kernel is of fourth order, (3 - u2)/2 times a normal density: parabolas pass unchanged. A rail at rest during
    events is not moved: its noise would only become another one, which some delay always fits better.
    """
    rail = measurement.recording.rail_pressure
    late, width = delay / measurement.interval, smoothing_of(measurement.interval) / measurement.interval
    if not _moves(measurement):
        late = 0.0
    available = np.isfinite(rail)
    if not available.all():  # outside of what is judged, but within the kernel's reach
        sample = np.arange(rail.size)
        rail = np.interp(sample, sample[available], rail[available])
    reach = int(np.ceil(KERNEL_REACH * width + abs(late)))
    u = (np.arange(-reach, reach + 1) - late) / width
    weights = (3.0 - u**2) * np.exp(-0.5 * u**2)
    beyond = np.pad(rail, reach, mode="edge")
    return np.asarray(np.convolve(beyond, weights[::-1] / weights.sum(), "valid"), np.float64)


def rail_on_time(measurement: Measurement, terms: InputTerms) -> NDArray[np.float64]:
    """Recorded rail pressure [Pa] (n,), smoothed, at the times of the other two channels."""
    half_period = 0.5 * measurement.interval if measurement.means else 0.0
    return true_rail_pressure(measurement, terms.rail_delay + half_period)


def _moves(measurement: Measurement) -> bool:
    rail, noise = measurement.recording.rail_pressure, measurement.noise.rail_pressure
    variance = np.mean([np.var(rail[event.start : event.end]) for event in measurement.events])
    return bool(variance > (1.0 + MOVING_SHARE**2) * noise**2)


class LiftNoise:
    """Variance that the noise of the lift adds to the normalised innovations of a recording, by the lag."""

    def __init__(self, measurement: Measurement, innovations: Innovations) -> None:
        self._measurement = measurement
        self._innovations = innovations
        self._cache: dict[int, NDArray[np.float64]] = {}

    def variance(self, lag: float) -> NDArray[np.float64]:
        """Variance (n,) added by a lag [s], linear between multiples of `LAG_GRID`, so that a fit meets no step."""
        below = math.floor(lag / LAG_GRID)
        share = lag / LAG_GRID - below
        added = (1.0 - share) * self._at(below) + share * self._at(below + 1)
        return np.asarray(np.maximum(added - self._at(0), 0.0))

    def _at(self, multiple: int) -> NDArray[np.float64]:
        """Variance (n,) with a lag of so many times LAG_GRID, by draws of the noise."""
        if multiple in self._cache:
            return self._cache[multiple]
        measurement, lag, rng = self._measurement, multiple * LAG_GRID, np.random.default_rng(0)
        recording = measurement.recording
        undisturbed = self._innovations(measurement, lag)
        squares = np.zeros(undisturbed.size)
        for _ in range(NOISE_DRAWS):
            noise = rng.normal(0.0, measurement.noise.needle_lift, recording.samples)
            louder = replace(recording, needle_lift=recording.needle_lift + noise)
            squares += (self._innovations(replace(measurement, recording=louder), lag) - undisturbed) ** 2
        mean = np.convolve(squares / NOISE_DRAWS, np.full(AVERAGED_SAMPLES, 1.0 / AVERAGED_SAMPLES), mode="same")
        self._cache[multiple] = variance = np.where(np.isfinite(mean), mean, 0.0)
        return variance
