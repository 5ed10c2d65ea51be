"""Noise of a needle lift that was restored from a lag, as it reaches the innovations through the seat.

y + lag y' has the noise of y several times over: 3 times for a lag of 40 us at 100 kHz. What that does to the line
pressure is no error of a model, and must not count as one.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.identification.likelihood.measurement import Measurement

DRAWS = 8  # of noise, by which a variance is found
GRID = 6e-6  # s of lag, at whose multiples it is found
SMOOTHED = 15  # samples over which it is averaged

Innovations = Callable[[Measurement, float], NDArray[np.float64]]
"""Normalised innovations (n,) of a recording with a lag [s] of its lift undone."""


class LiftNoise:
    """Variance that the noise of the lift adds to the normalised innovations of a recording, by the lag."""

    def __init__(self, measurement: Measurement, innovations: Innovations) -> None:
        self._measurement = measurement
        self._innovations = innovations
        self._cache: dict[int, NDArray[np.float64]] = {}

    def variance(self, lag: float) -> NDArray[np.float64]:
        """(n,): beyond that without a lag [s]; between multiples of `GRID` straight, so that a fit meets no step."""
        below = math.floor(lag / GRID)
        share = lag / GRID - below
        added = (1.0 - share) * self._at(below) + share * self._at(below + 1)
        return np.asarray(np.maximum(added - self._at(0), 0.0))

    def _at(self, multiple: int) -> NDArray[np.float64]:
        if multiple not in self._cache:
            self._cache[multiple] = self._estimate(multiple * GRID)
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
        mean = np.convolve(squares / DRAWS, np.full(SMOOTHED, 1.0 / SMOOTHED), mode="same")
        return np.where(np.isfinite(mean), mean, 0.0)
