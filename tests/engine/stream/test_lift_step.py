"""A zero of the lift that steps, or moves on while the needle is open, is no motion of the needle."""

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.engine.sample_stream import NOISE, Stream, beside_rest, opened

UM = 1e-6
LENGTH = 45_000  # samples at 100 kHz
OPENINGS = range(1500, 43_000, 3000)
OPEN_FOR = 150
STEP_AT = 19_300  # 2 ms before an opening
LATE = 10  # openings from the start, from which on all is settled


def run(disturbance: NDArray[np.float64], noise: float = NOISE.needle_lift, is_contradicted: bool = False) -> Stream:
    """is_contradicted: by a line pressure that never falls."""
    lift = opened(OPENINGS, LENGTH, OPEN_FOR) + disturbance
    lift += np.random.default_rng(4).normal(0.0, noise, LENGTH)
    return beside_rest(lift, innovation_weight=1e6 if is_contradicted else 0.0)


def durations(stream: Stream) -> NDArray[np.int64]:
    edges = np.flatnonzero(np.diff(np.concatenate(([False], stream.rows["seat_area"] > 0.0, [False]))))
    return edges[1::2] - edges[::2]


def edge_errors(stream: Stream, noise: float = NOISE.needle_lift) -> NDArray[np.float64]:
    """Lifts [m] on the flanks over those without disturbance, of the later openings."""
    plain = run(np.zeros(LENGTH), noise).rows["lift"]
    flanks = [np.arange(start + first, start + first + 15) for start in OPENINGS[-LATE:] for first in (3, 132)]
    difference = stream.rows["lift"] - plain
    return np.array([difference[flank].mean() for flank in flanks])


@pytest.mark.parametrize("step", [-12 * UM, -6 * UM, -3 * UM, 1.5 * UM, 3 * UM, 6 * UM, 12 * UM])
def test_a_zero_that_steps_is_another_one_at_once(step: float) -> None:
    stream = run(np.where(np.arange(LENGTH) >= STEP_AT, step, 0.0))
    assert len(stream.injections) == len(OPENINGS)
    assert np.abs(durations(stream) - OPEN_FOR).max() <= 1
    assert stream.rows["valid"][STEP_AT:].all()
    assert np.abs(edge_errors(stream)).max() < 0.5 * UM
    assert not stream.rows["seat_area"][STEP_AT : STEP_AT + 150].any()


@pytest.mark.parametrize(
    ("height", "before"),
    [(3 * UM, 16), (6 * UM, 14), (1.5 * UM, 25), (3 * UM, 25), (-3 * UM, 25), (1.5 * UM, 45), (6 * UM, 45)],
)
def test_the_current_through_the_coil_opens_no_needle(height: float, before: int) -> None:
    """It flows from before the opening until the needle is about to close."""
    current = np.zeros(LENGTH)
    for start in OPENINGS:
        current[start - before : start + OPEN_FOR - 30] = height
    stream = run(current)
    assert len(stream.injections) == len(OPENINGS)
    assert np.abs(durations(stream) - OPEN_FOR).max() <= 1
    assert np.abs(edge_errors(stream)).max() < 0.6 * UM
    assert abs(float(stream.observer.memory[0]["resting_lift"]["zero"])) < 0.3 * UM


@pytest.mark.parametrize("noise", [0.4 * UM, 1.2 * UM])
def test_hum_moves_the_zero_on_while_the_needle_is_open(noise: float) -> None:
    """By 1.4 um from edge to edge, where it is quickest; followed by a mean, the zero would be off by 1.4 rms."""
    stream = run(3 * UM * np.sin(2 * np.pi * 50.0 * np.arange(LENGTH) / 100e3 + 0.1), noise)
    assert len(stream.injections) == len(OPENINGS)
    assert np.sqrt(np.mean(edge_errors(stream, noise) ** 2)) < 0.7 * UM


def test_noise_neither_steps_nor_moves() -> None:
    for noise in (0.4 * UM, 2.4 * UM):
        stream = run(np.zeros(LENGTH), noise)
        assert float(stream.observer.memory[0]["lift_zero"]["slope"]) == 0.0
        assert int(stream.observer.memory[0]["lift_step"]["stepped"]) < 0


def test_a_needle_that_opens_slowly_is_no_step() -> None:
    """0.15 m/s, half as fast as the slowest."""
    rise = np.minimum(0.15 * np.arange(1, 201) / 100e3, 0.3e-3)
    lift = np.zeros(LENGTH)
    lift[18_000:18_200] = rise
    lift[18_200:18_400] = rise[::-1]
    opened = np.flatnonzero(run(lift).rows["seat_area"][17_900:18_500] > 0.0)
    assert opened[0] <= 102
    assert opened[-1] == pytest.approx(497, abs=5)


@pytest.mark.parametrize("step", [-27 * UM, 27 * UM])
def test_a_zero_that_steps_while_the_needle_is_open_is_found_in_rest(step: float) -> None:
    """Far from the dead band; the injection under way is too long by the time for which it must stay."""
    first = OPENINGS.index(18_000 + 1500)
    stream = run(np.where(np.arange(LENGTH) >= OPENINGS[first] + 60, step, 0.0), is_contradicted=True)
    assert len(stream.injections) == len(OPENINGS)
    longer = durations(stream) - OPEN_FOR
    assert longer[first] <= 2 * stream.observer.constants.timing.settle
    assert np.abs(np.delete(longer, first)).max() <= 1
    assert np.abs(edge_errors(stream)[-6:]).max() < 0.6 * UM


def test_noise_that_is_no_lift_opens_nothing_that_is_valid() -> None:
    """Of a lift in another unit: a thousand times as loud."""
    loud = np.where(np.arange(LENGTH) >= STEP_AT - 500, 400 * UM, 0.0)
    rows = run(loud * np.random.default_rng(3).normal(size=LENGTH)).rows[STEP_AT - 500 : STEP_AT + 1000]
    assert (rows["seat_area"] > 0.0).any()
    assert not (rows["valid"] & (rows["seat_area"] > 0.0)).any()
