"""Reports of noise that is not white name its frequency and strength; white noise is not reported."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from observer_rt.engine.service.noise import SlowNoise, slow_noise

WHITE = 0.15  # MPa


def resting_rows(samples: int = 30_000) -> NDArray[np.int64]:
    """Indices of samples at rest: of every 6000, 1500 are not."""
    index = np.arange(samples)
    return index[index % 6000 > 1500]


def white(index: NDArray[np.int64], seed: int = 1) -> NDArray[np.float64]:
    return WHITE * np.random.default_rng(seed).normal(size=index.size)


def noise_found(values: NDArray[np.float64], index: NDArray[np.int64], rate: float = 100e3) -> SlowNoise | None:
    return slow_noise(values, index, rate, WHITE)


@pytest.mark.parametrize("seed", range(10))
def test_of_white_noise_nothing_is_said(seed: int) -> None:
    assert noise_found(white(resting_rows(), seed) + 7.0, resting_rows()) is None


@pytest.mark.parametrize(
    ("rate", "hertz", "amplitude"),
    [*((100e3, *tone) for tone in ((50.0, 0.2), (50.0, 0.5), (150.0, 0.2), (620.0, 0.1))), (20e3, 50.0, 0.2)],
)
def test_hum_has_its_frequency_and_amplitude(rate: float, hertz: float, amplitude: float) -> None:
    index = resting_rows()
    tone = amplitude * np.sin(2.0 * math.pi * hertz * index / rate + 0.7)
    noise = noise_found(white(index) + tone, index, rate)
    assert noise is not None
    assert noise.frequency == pytest.approx(hertz, rel=0.03)
    assert noise.strength == pytest.approx(amplitude, rel=0.12)


def test_a_colour_has_its_strength() -> None:
    index = np.arange(60_000)
    pole = math.exp(-2.0 * math.pi * 3e3 / 100e3)
    drive = np.random.default_rng(2).normal(size=index.size)
    slow = 0.2 * math.sqrt(1.0 - pole**2) * lfilter([1.0], [1.0, -pole], drive)
    chosen = index % 6000 > 1500
    noise = noise_found(white(index[chosen]) + slow[chosen], index[chosen])
    assert noise is not None
    assert noise.frequency is None
    assert noise.strength == pytest.approx(0.2, rel=0.1)
    assert noise.as_text("kPa", 1e-3) == "colour 2e+02 kPa"


def test_few_samples_tell_nothing() -> None:
    index = np.arange(300)
    assert noise_found(np.sin(0.01 * index), index) is None


def test_short_stretches_are_enough_for_a_tone() -> None:
    index = np.concatenate([np.arange(100) + 700 * k for k in range(50)])
    noise = noise_found(white(index) + 0.4 * np.sin(2.0 * math.pi * 50.0 * index / 100e3), index)
    assert noise is not None
    assert noise.as_text("MPa", 1.0).startswith("hum 50 Hz 0.")


def test_what_decays_is_no_noise() -> None:
    index = resting_rows()
    ringing = 2.0 * np.exp(-(index % 6000 - 1500) / 800.0) * np.sin(2.0 * math.pi * 2e3 * index / 100e3)
    assert noise_found(white(index) + ringing, index) is None
