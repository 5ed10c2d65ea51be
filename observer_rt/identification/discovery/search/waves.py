"""Oscillations of a fixed frequency in the residuals: lines of their spectrum become candidate terms."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from observer_rt.model.effect import Effect
from observer_rt.model.term_effect import FormNumber, TermLaw, term_effect
from observer_rt.model.terms.term import TermEquation

LOWEST, HIGHEST = 200.0, 0.4  # Hz, and share of the sample rate
PADDED = 4  # zero padding: times as many frequencies as samples
AROUND = 500.0  # Hz: width of the running median of the spectrum
STANDS_OUT = 8.0  # times the median: least power of a line
LARGEST = 5.0  # standard deviations: residuals are clipped, since transients would hide an oscillation
APART = 50.0  # Hz: least distance of two lines
MOST_LINES = 2
SWINGING = (TermEquation.RAIL_PRESSURE, TermEquation.LINE_PRESSURE_SENSOR, TermEquation.CHAMBER_PRESSURE)
"""Equations that may hold an oscillating term; not outflows, since fuel would flow back half of the time."""


def waves(frequencies: Sequence[float], longest: float) -> list[tuple[Effect, Effect]]:
    """Sine and cosine terms of every frequency [Hz] in every equation; longest: longest recording [s]."""
    pairs = []
    for frequency in frequencies:
        # a recording of length T resolves a frequency to 1/T
        numbers = FormNumber(frequency, frequency - 1.0 / longest, frequency + 1.0 / longest)
        for equation in SWINGING:
            sine, cosine = (
                term_effect(
                    equation, "sin(6.283185307*A[Hz]*time + W)", (numbers, FormNumber(phase, -4.0, 4.0))
                )
                for phase in (0.0, 0.5 * math.pi)
            )
            pairs.append((sine, cosine))
    return pairs


def turned(sine: Effect, swings: Sequence[float]) -> Effect:
    """One term with a phase, for these amplitudes of the sine and cosine terms."""
    law = sine.apply
    assert isinstance(law, TermLaw)
    frequency, phase = law.numbers
    angle = math.atan2(swings[1], swings[0])
    return term_effect(law.equation, law.form, (frequency, phase._replace(value=angle)))


def lines(
    left: Sequence[NDArray[np.float64]], times: Sequence[NDArray[np.float64]], interval: float
) -> list[float]:
    """Frequencies [Hz] that stand out of the spectrum of the residuals, the strongest first.

    left: normalised residuals (n,) of each recording; times: theirs [s] (n,), whole numbers of intervals apart.
    """
    size = 1 << math.ceil(math.log2(PADDED * max(one[-1] - one[0] for one in times) / interval))
    power = np.zeros(size // 2 + 1)
    for values, when in zip(left, times, strict=True):
        grid = np.zeros(size)
        grid[np.rint((when - when[0]) / interval).astype(np.int64)] = np.clip(values, -LARGEST, LARGEST)
        power += np.abs(np.fft.rfft(grid)) ** 2
    step = 1.0 / (size * interval)
    coarse = 8  # every 8th bin is enough for the median
    background = np.repeat(median_filter(power[::coarse], max(3, round(AROUND / step / coarse))), coarse)
    power = np.where(power > STANDS_OUT * background[: power.size], power, 0.0)
    first, last = round(LOWEST / step), round(HIGHEST / (interval * step))
    power[:first] = power[last:] = 0.0
    frequencies: list[float] = []
    while len(frequencies) < MOST_LINES and power.any():
        top = int(np.argmax(power))
        frequencies.append(top * step)
        power[max(0, top - round(APART / step)) : top + round(APART / step)] = 0.0
    return frequencies
