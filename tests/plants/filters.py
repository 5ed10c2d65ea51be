"""Analog filters of a signal: their responses at frequencies [Hz], delays, and a signal through them."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, freqs, lfilter

from tests.plants.arrays import Array

DAMPING = 0.05  # of a resonance
Response = Callable[[Array], NDArray[np.complex128]]


def filtered(values: Array, interval: float, response: Response) -> Array:
    tail = np.linspace(values[-1], values[0], values.size)  # back to the start, so that nothing jumps
    extended = np.concatenate((values, tail))
    frequencies = np.asarray(np.fft.rfftfreq(extended.size, interval), np.float64)
    spectrum: NDArray[np.complex128] = np.fft.rfft(extended)
    spectrum *= response(frequencies)
    return np.asarray(np.fft.irfft(spectrum, extended.size)[: values.size], np.float64)


def butterworth(order: int, corner: float) -> Response:
    """Of this order and corner [Hz]."""
    b, a = butter(order, 2.0 * math.pi * corner, analog=True)
    return lambda frequency: freqs(b, a, 2.0 * math.pi * frequency)[1]


def butterworth_delay(order: int, corner: float) -> float:
    """Its delay of slow signals [s]: the sum of 1/Q over its corner."""
    angles = math.pi * (2.0 * np.arange(order) + 1.0) / (2.0 * order)
    return float(np.sum(np.sin(angles)) / (2.0 * math.pi * corner))


def resonance(frequency: float, damping: float = DAMPING) -> Response:
    """A weakly damped sensor [Hz]."""

    def response(f: Array) -> NDArray[np.complex128]:
        s = 1j * f / frequency
        return np.asarray(1.0 / (1.0 + 2.0 * damping * s + s * s), np.complex128)

    return response


def first_order(corner: float) -> Response:
    return lambda f: np.asarray(1.0 / (1.0 + 1j * f / corner), np.complex128)


def coloured_noise(noise: Array, interval: float, corner: float) -> Array:
    """White noise through a first-order filter [Hz], of the same standard deviation."""
    pole = math.exp(-2.0 * math.pi * corner * interval)
    drive = noise * math.sqrt(1.0 - pole * pole)
    drive[0] = noise[0]
    return np.asarray(lfilter([1.0], [1.0, -pole], drive), np.float64)
