"""Noise levels from the data."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import butter, lfilter

from observer_rt.identification.likelihood.events import FEWEST_DIFFERENCES, noise_level, white_noise

RATE = 100e3
EVERYWHERE = np.ones(20_000, np.bool_)


def _noise(seed: int = 1) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.random.default_rng(seed).normal(size=EVERYWHERE.size)


def test_ringing_ramps_and_spikes_do_not_count_as_noise() -> None:
    time = np.arange(EVERYWHERE.size) / RATE
    signal = 30.0 * np.sin(2 * math.pi * 1280.0 * time) + 5000.0 * time
    spikes = np.where(np.arange(time.size) % 1000 == 0, 40.0, 0.0)
    assert white_noise(signal + spikes + _noise(), EVERYWHERE) == pytest.approx(1.0, rel=0.03)
    assert noise_level(signal + spikes + _noise(), EVERYWHERE, RATE) == pytest.approx(1.0, rel=0.03)


def test_the_ringing_of_a_line_sampled_slowly_is_no_noise() -> None:
    ringing = 10.0 * np.sin(2 * math.pi * 1280.0 * np.arange(EVERYWHERE.size) / 10e3)
    assert noise_level(ringing + _noise(), EVERYWHERE, 10e3) == pytest.approx(1.0, rel=0.1)


def test_noise_behind_an_anti_alias_filter_is_as_strong_as_where_the_line_rings() -> None:
    """Two poles at .28 of the sample rate take two thirds of what neighbours differ by, and nothing of a mean."""
    time = np.arange(EVERYWHERE.size) / RATE
    fine = np.random.default_rng(1).normal(size=8 * EVERYWHERE.size) * math.sqrt(8.0)
    filtered = lfilter(*butter(2, 28e3, fs=8 * RATE), fine)[::8] + 30.0 * np.sin(2 * math.pi * 1280.0 * time)
    assert white_noise(filtered, EVERYWHERE) < 0.5
    assert noise_level(filtered, EVERYWHERE, RATE) == pytest.approx(0.85, abs=0.1)


def test_only_whole_runs_of_chosen_samples_count() -> None:
    values = _noise()
    chosen = np.arange(values.size) < 12_000
    values[12_000:] *= 50.0
    values[500::700] = math.nan
    assert white_noise(values, chosen) == pytest.approx(1.0, rel=0.03)


def test_coarse_codes_are_no_obstacle() -> None:
    rounded = np.rint(_noise() / 0.5) * 0.5
    assert white_noise(rounded, EVERYWHERE) == pytest.approx(math.hypot(1.0, 0.5 / math.sqrt(12)), rel=0.03)


def test_too_few_samples_give_no_answer() -> None:
    chosen = np.arange(EVERYWHERE.size) < FEWEST_DIFFERENCES
    assert math.isnan(white_noise(_noise(), chosen))


def test_a_signal_without_noise_has_none() -> None:
    assert white_noise(np.full(EVERYWHERE.size, 3.0), EVERYWHERE) == 0.0


@given(scale=st.floats(1e-9, 1e9), level=st.floats(-1e3, 1e3))
def test_the_level_scales_with_the_signal_and_ignores_a_constant(scale: float, level: float) -> None:
    values = _noise()
    expected = scale * white_noise(values, EVERYWHERE)
    assert white_noise(scale * (values + level), EVERYWHERE) == pytest.approx(expected, rel=1e-6)
