"""Slow noise of signals at rest beside their white noise: hum, or a colour.

scipy.signal is imported where it is called: no other import takes as long, and the daemon's start needs none of it.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LEAST_SHARE = 0.08  # of the white variance, below which slow noise is not reported
ONE_TONE = 0.6  # share of the slow noise at one frequency, from which on it is hum
SLOWEST, SLOW = 5.0, 800.0  # Hz, between which a tone is sought over all stretches together
BLOCKS_A_PERIOD = 4  # blocks in a period of the fastest of these tones
MOST_BLOCKS = 8_000  # in which a tone is sought
DECAYING = 2.0  # ratio of the squares early at rest to those late, beyond which they are an echo
FEWEST = 512  # samples, below which nothing is reported


@dataclass(frozen=True)
class SlowNoise:
    """Noise beside white noise: hum, a slow tone, or a colour."""

    frequency: float | None  # of the tone [Hz]; None: a colour
    strength: float  # amplitude of a tone, else standard deviation, in the unit of the signal

    def as_text(self, unit: str, size: float) -> str:
        """Describes the noise in words, its strength in a unit of this size."""
        strength = f"{self.strength / size:.2g} {unit}"
        if self.frequency is None:
            return f"colour {strength}"
        return f"hum {float(f'{self.frequency:.2g}'):.0f} Hz {strength}"


def slow_noise(
    values: NDArray[np.float64], index: NDArray[np.int64], sample_rate: float, white: float
) -> SlowNoise | None:
    """Slow noise of samples (n,) at rest with their sample index; None: they are white, or too few.

    white: standard deviation of the white part; sample_rate [Hz].
    """
    if values.size < FEWEST:
        return None
    values = values - values.mean()
    beyond = float(np.mean(values**2)) - white**2
    if beyond < LEAST_SHARE * white**2:
        return None
    stretches = np.split(np.arange(values.size), np.flatnonzero(np.diff(index) != 1) + 1)
    if _decays(values, stretches):
        return None
    frequency, power = _slow_tone(values, index, stretches, sample_rate)
    if power > ONE_TONE * beyond:
        return SlowNoise(frequency, math.sqrt(2.0 * power))
    return SlowNoise(None, math.sqrt(beyond))


def _decays(values: NDArray[np.float64], stretches: list[NDArray[np.int64]]) -> bool:
    """Whether values are smaller in the second halves of the stretches: an echo of the motion before these."""
    first = sum(float(np.sum(values[s[: s.size // 2]] ** 2)) for s in stretches)
    second = sum(float(np.sum(values[s[-(s.size // 2) :]] ** 2)) for s in stretches if s.size > 1)
    return first > DECAYING * second


def _slow_tone(
    values: NDArray[np.float64], index: NDArray[np.int64], stretches: list[NDArray[np.int64]], sample_rate: float
) -> tuple[float, float]:
    """Frequency [Hz] and mean square of the strongest slow tone, over all stretches at once; 0 without a block."""
    from scipy.signal import lombscargle

    length = max(1, round(sample_rate / (BLOCKS_A_PERIOD * SLOW)))
    blocks = [s[: s.size // length * length].reshape(-1, length) for s in stretches if s.size >= length]
    if not blocks:
        return 0.0, 0.0
    joined = np.concatenate(blocks)[-MOST_BLOCKS:]
    means, time = values[joined].mean(axis=1), index[joined].mean(axis=1) / sample_rate
    resolution = 0.25 / max(float(time[-1] - time[0]), 1e-3)
    frequencies = np.arange(SLOWEST, SLOW, max(resolution, (SLOW - SLOWEST) / MOST_BLOCKS))
    power = lombscargle(time, means, 2.0 * math.pi * frequencies)
    best = int(np.argmax(power))
    return float(frequencies[best]), 2.0 * float(power[best]) / means.size
