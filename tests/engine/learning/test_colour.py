"""Colour of the noise at rest: found where the noise is coloured and only there, whitened, and forgotten again."""

import math
from functools import reduce

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.noise import Colour, RestingNoise, resting_segments

INTERVAL = 1e-5  # s
REST = 700  # samples of an event at 100 kHz
SIGMA = 0.154  # MPa, of white innovations


def rested(events: list[NDArray[np.float64]], interval: float = INTERVAL) -> RestingNoise:
    return reduce(lambda noise, values: noise.after([values], interval), events, RestingNoise())


def found_in(events: list[NDArray[np.float64]], interval: float = INTERVAL) -> Colour | None:
    return rested(events, interval).colour(None, interval)


def white(seed: int, events: int = 8, samples: int = REST) -> list[NDArray[np.float64]]:
    random = np.random.default_rng(seed)
    return [random.normal(size=samples) for _ in range(events)]


def with_hum(events: list[NDArray[np.float64]], hertz: float, interval: float) -> list[NDArray[np.float64]]:
    phases = np.random.default_rng(5).uniform(0.0, 2.0 * math.pi, len(events))
    time = np.arange(len(events[0])) * interval
    hum = 0.2 / SIGMA
    return [values + hum * np.sin(2.0 * math.pi * hertz * time + p) for values, p in zip(events, phases, strict=True)]


def first_order(events: list[NDArray[np.float64]], pole: float) -> list[NDArray[np.float64]]:
    return [np.asarray(lfilter([1.0], [1.0, -pole], values), np.float64) for values in events]


def correlations(values: NDArray[np.float64]) -> NDArray[np.float64]:
    products = [float(np.mean(values[lag:] * values[:-lag])) for lag in range(1, 21)]
    return np.array(products) / float(np.mean(values**2))


@pytest.mark.parametrize("seed", range(40))
def test_white_noise_has_none(seed: int) -> None:
    assert all(found_in(white(seed, events)) is None for events in (1, 3, 8))


def behind_a_line(seed: int) -> list[NDArray[np.float64]]:
    """White noise, and pink noise of the rail behind a line, whose spectrum falls more steeply."""
    random = np.random.default_rng(seed)
    shape = np.append(0.0, np.fft.rfftfreq(200_000)[1:] ** -0.75)
    pink = np.fft.irfft(shape * np.fft.rfft(random.normal(size=200_000)))
    slow = lfilter([0.1], [1.0, -0.9], pink)
    slow *= 5.0 / np.std(slow)
    starts = random.integers(0, slow.size - REST, 20)
    return [slow[start : start + REST] + random.normal(size=REST) for start in starts]


@pytest.mark.parametrize("seed", range(3))
def test_what_is_left_of_pink_noise_is_white_over_blocks_too(seed: int) -> None:
    """Single samples show little of the slow part: a filter chosen by them alone leaves 1.66 over blocks (seed 1)."""
    events = behind_a_line(seed)
    colour = found_in(events)
    assert colour is not None
    left = [colour.whitening.of(values)[60:] / colour.sigma for values in events]
    blocks = np.concatenate([values.reshape(-1, 20).mean(axis=1) for values in left])
    assert 20.0 * np.mean(blocks**2) < 1.45


@pytest.mark.parametrize("position", [0, 5])
def test_a_false_event_leaves_no_colour_behind(position: int) -> None:
    """A dropout that looks like an opening leaves innovations that are many times larger and far from white."""
    events = white(4, 12)
    events[position] = 20.0 * first_order([events[position]], 0.95)[0]
    colour = found_in(events)
    left = events[-1] if colour is None else colour.whitening.of(events[-1])
    assert np.mean((left - events[-1]) ** 2) < 0.25


def test_white_noise_of_another_level_has_none() -> None:
    assert found_in([2.0 * values for values in white(1)]) is None


def test_noise_below_the_expected_level_has_no_colour() -> None:
    noise = rested(first_order(white(3), 0.83))
    loudness = 1.0 / math.sqrt(1.0 - 0.83**2)
    assert noise.colour(None, INTERVAL, expected=loudness) is not None
    assert noise.colour(None, INTERVAL, expected=2.0 * loudness) is None


@pytest.mark.parametrize(("interval", "samples"), [(1e-5, 700), (5e-5, 140)])
def test_hum_is_removed_by_a_high_pass(interval: float, samples: int) -> None:
    events = with_hum(white(2, samples=samples), 50.0, interval)
    colour = found_in(events, interval)
    assert colour is not None
    assert colour.whitening.forgetting is not None
    assert colour.interval == interval
    left = np.concatenate([colour.whitening.of(values)[1:] for values in events])
    assert np.std(left) == pytest.approx(colour.sigma, rel=0.04)
    by_high_pass = math.sqrt(2.0 / (1.0 + colour.whitening.forgetting))  # of white noise
    assert colour.sigma == pytest.approx(by_high_pass, rel=0.04)
    assert np.abs(correlations(left)).max() < 4.0 / math.sqrt(left.size)


@pytest.mark.parametrize("pole", [0.83, 0.3, -0.5])
def test_noise_through_a_filter_is_made_white(pole: float) -> None:
    events = first_order(white(3), pole)
    colour = found_in(events)
    assert colour is not None
    left = np.concatenate([colour.whitening.of(values)[21:] for values in events])
    assert np.std(left) == pytest.approx(colour.sigma, rel=0.04)
    assert colour.sigma == pytest.approx(1.0, abs=0.04)
    assert np.abs(correlations(left)).max() < 4.0 / math.sqrt(left.size)


def test_a_tone_is_found() -> None:
    assert found_in(with_hum(white(4), 620.0, INTERVAL)) is not None


def test_a_hum_that_has_ended_is_forgotten() -> None:
    hum = with_hum(white(6), 50.0, INTERVAL)
    before = found_in(hum)
    assert before is not None
    assert rested(hum + white(7, events=40)).colour(before, INTERVAL) is None


def test_without_rest_the_colour_stays() -> None:
    before = found_in(with_hum(white(8), 50.0, INTERVAL))
    assert RestingNoise().after([], INTERVAL).colour(before, INTERVAL) is before


def test_segments_are_long_enough_and_late_enough() -> None:
    resting = np.zeros(1000, np.bool_)
    resting[:100] = True
    resting[200:520] = True
    resting[600:] = True
    window = Window(np.zeros((1000, 2)), np.zeros(1000), resting, np.zeros(4), 100)
    assert resting_segments(window, 50, 300) == [slice(200, 520), slice(600, 1000)]
    assert resting_segments(window, 300, 300) == [slice(600, 1000)]
    assert resting_segments(window, 50, 40)[0] == slice(50, 100)
    masked = np.zeros(1000, np.bool_)
    masked[650:655] = True
    assert resting_segments(window._replace(masked=masked), 50, 300) == [slice(200, 520), slice(655, 1000)]
