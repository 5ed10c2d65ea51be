"""Phases of an event, and statistics that are 1 for white innovations and for nothing else."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import chi2, norm

from observer_rt.core.learning.phases import phases_of
from observer_rt.engine.estimation.phases import BLOCKS, Phase, PhaseStatistics, no_statistics, phase_statistics
from observer_rt.engine.estimation.predictor import Window

EDGE, AFTERGLOW = 30, 5  # samples at 100 kHz
RESTING_AFTER = 300
SIGMA = 1.5e-3


def window_with(openings: dict[int, int], samples: int) -> Window:
    """A window with openings {first open sample: samples open}, resting 3 ms after each and before the first."""
    area = np.zeros(samples)
    for start, length in openings.items():
        area[start : start + length] = 0.9
    last_open = np.where(area > 0.0, np.arange(samples), -samples)
    resting = (area == 0.0) & (np.arange(samples) - np.maximum.accumulate(last_open) > RESTING_AFTER)
    inputs = np.column_stack([np.full(samples, 0.95), area])
    return Window(inputs, np.full(samples, 0.95), resting, np.zeros(4), min(openings))


def runs(phases: NDArray[np.int8]) -> list[tuple[Phase, int]]:
    edges = np.flatnonzero(np.diff(phases)) + 1
    return [(Phase(int(part[0])), part.size) for part in np.split(phases, edges)]


def test_between_pilot_and_main_it_is_after_the_pilot() -> None:
    assert runs(phases_of(window_with({100: 80, 240: 100}, 1200), EDGE, AFTERGLOW)) == [
        (Phase.STANDSTILL, 100),
        (Phase.OPENING, 30),
        (Phase.OPEN, 20),
        (Phase.CLOSING, 35),
        (Phase.AFTER, 55),
        (Phase.OPENING, 30),
        (Phase.OPEN, 40),
        (Phase.CLOSING, 35),
        (Phase.AFTER, RESTING_AFTER - AFTERGLOW),
        (Phase.STANDSTILL, 1200 - 340 - RESTING_AFTER),
    ]


@pytest.mark.parametrize("length", [1, 2, 25, 59, 60])
def test_ballistic_stroke_opens_and_closes_and_is_never_open(length: int) -> None:
    assert runs(phases_of(window_with({100: length}, 200), EDGE, AFTERGLOW)) == [
        (Phase.STANDSTILL, 100),
        (Phase.OPENING, (length + 1) // 2),
        (Phase.CLOSING, length // 2 + AFTERGLOW),
        (Phase.AFTER, 100 - length - AFTERGLOW),
    ]


def white(seed: int, samples: int) -> NDArray[np.float64]:
    return SIGMA * np.random.default_rng(seed).normal(size=samples)


def events(seed: int, colour: float) -> PhaseStatistics:
    """Many events of an autoregressive noise of variance SIGMA^2; colour 0 is white."""
    phases = phases_of(window_with({100: 150}, 1200), EDGE, AFTERGLOW)
    total = no_statistics()
    for k in range(40):
        drive = white(1000 * seed + k, 1200) * np.sqrt(1.0 - colour**2)
        total = total.faded(1.0, phase_statistics(lfilter([1.0], [1.0, -colour], drive), SIGMA, phases, 50))
    return total


@pytest.mark.parametrize("phase", Phase)
def test_white_noise_gives_one_within_its_error(phase: Phase) -> None:
    statistics = events(1, colour=0.0)
    samples = statistics.samples[phase]
    assert statistics.variance(phase) == pytest.approx(1.0, abs=4 * np.sqrt(2 / samples))
    for i, length in enumerate(BLOCKS):
        blocks = statistics.blocks[phase, i]
        assert samples / length * 0.5 < blocks <= samples / length
        mean_square = statistics.block_squares[phase, i] / blocks
        assert mean_square == pytest.approx(1.0, abs=4 * np.sqrt(2 / blocks))
    assert abs(statistics.excess(phase)) < 4.0


@pytest.mark.parametrize("phase", Phase)
def test_colour_is_found_where_the_variance_is_right(phase: Phase) -> None:
    """Neighbours correlated by 0.6: blocks of 20 have (1 + 0.6) / (1 - 0.6) = 4 times the variance, almost."""
    statistics = events(2, colour=0.6)
    assert statistics.variance(phase) == pytest.approx(1.0, abs=0.15)
    lag = np.arange(1, BLOCKS[1])
    expected = 1.0 + 2.0 * float(((1 - lag / BLOCKS[1]) * 0.6**lag).sum())
    error = expected * np.sqrt(2 / statistics.blocks[phase, 1])
    assert statistics.block_squares[phase, 1] / statistics.blocks[phase, 1] == pytest.approx(expected, abs=4 * error)
    assert statistics.colour(phase) > 2.5
    assert statistics.excess(phase) > 8.0
    for limit, variance, is_beyond in ((0.99, 2.0, True), (1.01, 0.8, True), (1.01, 2.0, False)):
        excess = statistics.excess_beyond(limit * statistics.colour(phase), np.full(len(Phase), variance))
        assert (excess[phase] == statistics.excess(phase)) == is_beyond


@pytest.mark.parametrize("blocks", [1, 2, 5, 20, 200, 5000])
@pytest.mark.parametrize("sigmas", [0.0, 2.0, 3.0, 4.5])
def test_excess_is_as_improbable_as_it_says(blocks: int, sigmas: float) -> None:
    """Against the exact distribution of a sum of squares; few blocks have a long tail."""
    total = float(chi2.isf(norm.sf(sigmas), blocks))
    statistics = no_statistics()
    statistics.blocks[Phase.OPEN, 1], statistics.block_squares[Phase.OPEN, 1] = blocks, total
    tolerance = 0.4 if blocks < 5 else 0.2 if blocks < 20 else 0.05
    assert statistics.excess(Phase.OPEN) == pytest.approx(sigmas, abs=tolerance)


def test_only_what_happened_is_counted() -> None:
    phases = np.repeat([Phase.STANDSTILL, Phase.OPEN, Phase.STANDSTILL], [100, 30, 19]).astype(np.int8)
    statistics = phase_statistics(np.ones(149), 2.0, phases, first=10)
    assert statistics.samples.tolist() == [90 + 19, 0, 30, 0, 0]
    assert statistics.squares.tolist() == [109 / 4, 0.0, 30 / 4, 0.0, 0.0]
    # blocks do not reach over the end of a phase: 90 // 8 + 19 // 8, 90 // 20 + 19 // 20
    assert statistics.blocks[Phase.STANDSTILL].tolist() == [11 + 2, 4]
    assert statistics.blocks[Phase.OPEN].tolist() == [3, 1]
    assert statistics.block_squares[Phase.OPEN].tolist() == [3 * 8 / 4, 20 / 4]
    assert statistics.variance(Phase.AFTER) == 1.0
    assert (statistics.colour(Phase.AFTER), statistics.excess(Phase.AFTER)) == (1.0, 0.0)


@given(st.integers(0, 1000), st.integers(1, 500))
def test_statistics_add_up_over_events(seed: int, length: int) -> None:
    phases = np.full(length, int(Phase.AFTER), np.int8)
    first_event = phase_statistics(white(seed, length), SIGMA, phases, 0)
    other = phase_statistics(white(seed + 1, length), SIGMA, phases, 0)
    both = first_event.faded(0.5, other)
    for name, sums in vars(both).items():
        np.testing.assert_allclose(sums, 0.5 * vars(first_event)[name] + vars(other)[name])
