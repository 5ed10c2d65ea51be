"""Clocks of devices by their stamps alone: offset, drift, and the uncertainty they claim."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.bus.alignment import jitter_of
from observer_rt.core.frames.frames import WINDOW, Numbering, time_frame
from tests.bus.alignment.alignment_driver import keeping_of

EPOCH = 1_700_000_000_000_000_000  # ns
INTERVAL = 50e-6  # s
DELAY = 150e3  # ns, of the promptest frame


def sent(seconds: float, drift: float = 0.0, samples: int = 1) -> NDArray[np.float64]:
    last = np.arange(samples, int(seconds / INTERVAL) + 1, samples) - 1
    return np.asarray(last * INTERVAL * 1e9 * (1.0 + drift))


def fed(stamps: NDArray[np.float64], samples: int = 1, shortest: float = 0.0) -> NDArray[np.void]:
    keeping = keeping_of(Numbering.INDEX, INTERVAL, samples, shortest=shortest)
    for number, stamp in enumerate(stamps):
        time_frame(keeping, 0, 0, (number + 1) * samples - 1, EPOCH + round(stamp))
    return keeping.clocks


def error(clock: NDArray[np.void], sent_last: float, last: int) -> float:
    line = clock[0]
    came = int(line["first_stamp"]) - EPOCH + line["offset"]
    came += (last - int(line["first_index"])) * (line["interval"] + line["drift"])
    return float(came - sent_last - DELAY) * 1e-9


@pytest.mark.parametrize("drift", [0.0, 50e-6, -200e-6])
@pytest.mark.parametrize("samples", [1, 28])
def test_prompt_frames_tell_offset_and_drift_exactly(drift: float, samples: int) -> None:
    taken = sent(2.0, drift, samples)
    clock = fed(taken + DELAY, samples)
    assert abs(error(clock, taken[-1], len(taken) * samples - 1)) < 1e-9
    assert clock["residual"][0] < 2.0
    assert clock["drift"][0] / clock["interval"][0] == pytest.approx(drift, abs=1e-9)


@settings(max_examples=10)
@given(st.integers(0, 1000), st.floats(-200e-6, 200e-6), st.floats(0.6, 1.0), st.floats(1e3, 1e5))
def test_late_frames_beside_prompt_move_nothing(seed: int, drift: float, prompt_share: float, width: float) -> None:
    random = np.random.default_rng(seed)
    taken = sent(1.6, drift)
    late = np.where(random.random(taken.size) < prompt_share, 0.0, random.uniform(0.0, width, taken.size))
    clock = fed(np.maximum.accumulate(taken + DELAY + late))
    assert abs(error(clock, taken[-1], taken.size - 1)) < 0.5e-6
    assert clock["residual"][0] < 0.5e3


@pytest.mark.slow
@settings(max_examples=20)
@given(
    st.integers(0, 1000),
    st.floats(-100e-6, 100e-6),
    st.sampled_from([1, 9, 28]),
    st.floats(5e3, 1e6),
    st.sampled_from([125e3, 1e6]),
    st.booleans(),
)
def test_what_is_claimed_is_no_less_than_the_error(
    seed: int, drift: float, samples: int, width: float, period: float, is_batched: bool
) -> None:
    """Jitter of every frame, and adapters that hand frames over in batches, even such as divide the cycle."""
    random = np.random.default_rng(seed)
    taken = sent(2.0, drift, samples)
    come = taken + DELAY + random.uniform(0.0, width, taken.size)
    if is_batched:
        come = np.ceil((taken + DELAY) / period) * period
    clock = fed(np.maximum.accumulate(come), samples, 20e-6)
    assert abs(error(clock, taken[-1], taken.size * samples - 1)) <= clock["residual"][0] * 1e-9 + 1e-6


def test_wrong_sample_rate_is_never_certain() -> None:
    clock = fed(sent(2.0, 1e-3) + DELAY)
    assert clock["residual"][0] == np.inf


def test_nothing_is_certain_at_first() -> None:
    assert fed(sent(0.6) + DELAY)["residual"][0] == np.inf


@pytest.mark.parametrize("step", [-5e6, 3.6e12])
def test_receivers_clock_set_anew_is_noticed_and_learned(step: float) -> None:
    taken = sent(4.0)
    come = taken + DELAY + np.where(taken > 2e9, step, 0.0)
    shortly = int((2e9 + 2 * WINDOW) / (INTERVAL * 1e9))
    assert fed(come[:shortly])["residual"][0] == np.inf
    after = fed(come)
    assert after["residual"][0] < 1.0
    assert abs(error(after, taken[-1] + step, taken.size - 1)) < 1e-9


def test_the_usual_delay_is_the_greatest_of_the_first_four_windows() -> None:
    taken = sent(0.85)
    late = np.where(np.arange(taken.size) % 2, 40e3, 0.0) * np.where(taken > 3 * WINDOW, 2.0, 1.0)
    assert fed(taken + DELAY + late)["usual"][0] == pytest.approx(80e3)


def test_jitter_is_that_of_the_delays() -> None:
    random = np.random.default_rng(3)
    taken = sent(2.0)
    late = np.where(np.arange(taken.size) % 2 == 0, 0.0, random.uniform(0.0, 80e3, taken.size))
    jitter = jitter_of(fed(taken + DELAY + late)[0])
    assert jitter.sigma * 1e9 == pytest.approx(late.std(), rel=0.03)
    assert jitter.greatest * 1e9 == pytest.approx(late.max(), rel=0.01)
    assert jitter_of(fed(np.empty(0))[0]).frames == 0
