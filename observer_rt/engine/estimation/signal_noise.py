"""Noise of the signals at rest beside white noise: hum, or a colour.

scipy.signal is imported where it is called: no other import takes as long, and the daemon's start needs none of it.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LEAST_SHARE = 0.08  # of the white variance, below which nothing is spoken of
ONE_TONE = 0.6  # of what is not white: so much of it at one frequency is hum
SLOWEST, SLOW = 5.0, 800.0  # Hz, between which a tone is sought over all stretches together
BLOCKS_A_PERIOD = 4  # of the fastest of these tones
MOST_BLOCKS = 8_000
SEGMENT = 1024  # samples of a spectrum of single stretches
DECAYING = 2.0  # mean squares, early over late at rest
FEWEST = 512  # samples, without which nothing is reported


@dataclass(frozen=True)
class SlowNoise:
    """Noise beside white noise: a tone of this frequency [Hz], or what lies half below and half above it.

    strength: amplitude of a tone, else standard deviation, in the unit of the signal.
    """

    frequency: float
    strength: float
    is_tone: bool

    def as_text(self, unit: str, size: float) -> str:
        """Describes the noise in words, its strength in a unit of this size."""
        strength = f"{self.strength / size:.2g} {unit}"
        if self.is_tone:
            return f"hum {_rounded(self.frequency)} Hz {strength}"
        return f"colour {strength}, half of it below {_rounded(self.frequency)} Hz"


def slow_noise(
    values: NDArray[np.float64], index: NDArray[np.int64], sample_rate: float, white: float
) -> SlowNoise | None:
    """Finds the slow noise of samples (n,) at rest with their sample index; None: white noise or too few of them.

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
    spectrum = _spectrum(values, stretches, sample_rate, white)
    frequency, power = max(
        _slow_tone(values, index, stretches, sample_rate), _spectrum_tone(*spectrum), key=lambda tone: tone[1]
    )
    if power > ONE_TONE * beyond:
        return SlowNoise(frequency, math.sqrt(2.0 * power), is_tone=True)
    return SlowNoise(_middle(*spectrum), math.sqrt(beyond), is_tone=False)


def _decays(values: NDArray[np.float64], stretches: list[NDArray[np.int64]]) -> bool:
    """Whether it is less in the second halves of the stretches: then it is an echo of what was before them."""
    first = sum(float(np.sum(values[s[: s.size // 2]] ** 2)) for s in stretches)
    second = sum(float(np.sum(values[s[-(s.size // 2) :]] ** 2)) for s in stretches if s.size > 1)
    return first > DECAYING * second


def _slow_tone(
    values: NDArray[np.float64],
    index: NDArray[np.int64],
    stretches: list[NDArray[np.int64]],
    sample_rate: float,
) -> tuple[float, float]:
    """Frequency [Hz] and mean square of the strongest slow tone, over all stretches at once."""
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


def _spectrum(
    values: NDArray[np.float64], stretches: list[NDArray[np.int64]], sample_rate: float, white: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies [Hz] and mean squares beside white noise, on the mean of the stretches."""
    from scipy.signal import welch

    length = min(SEGMENT, max(stretch.size for stretch in stretches))
    total, count = np.zeros(length // 2 + 1), 0
    for stretch in stretches:
        if stretch.size >= length:
            frequencies, density = welch(values[stretch], sample_rate, nperseg=length, detrend=False)
            total, count = total + stretch.size * density, count + stretch.size
    return frequencies, total / count * frequencies[1] - white**2 / (length // 2)


def _spectrum_tone(frequencies: NDArray[np.float64], power: NDArray[np.float64]) -> tuple[float, float]:
    """Frequency [Hz] and mean square of the strongest tone of a spectrum faster than the slow ones."""
    power = np.convolve(np.where(frequencies >= SLOW, power, 0.0), np.ones(3), mode="same")
    best = int(np.argmax(power))
    return float(frequencies[best]), float(power[best])


def _middle(frequencies: NDArray[np.float64], power: NDArray[np.float64]) -> float:
    """Frequency [Hz] of a spectrum below which half of the coloured part lies."""
    below = np.cumsum(np.maximum(power, 0.0))
    return float(frequencies[max(1, int(np.searchsorted(below, 0.5 * below[-1])))])


def _rounded(frequency: float) -> str:
    return f"{float(f'{frequency:.2g}'):.0f}"
