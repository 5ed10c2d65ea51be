"""How far the needle opens, and when one counts as shut whose sensor creeps."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.engine.stream.standstill import lift_figures
from tests.engine.sample_stream import NOISE, Stream, beside_rest, opened, stroke

STOP = 0.3e-3  # m

UM = 1e-6
LENGTH = 30_000  # samples at 100 kHz
OPENINGS = range(1500, 25_000, 5000)
OPEN_FOR = 150
CREEP_DECAY = 1500  # samples; time constant by which a creep fades


def figures(peaks: list[float], open_for: int = 110, drift: float = 0.0) -> tuple[float, bool]:
    """Lift at the stop and whether it is to scale, from openings that go so far [m]."""
    length = 2000 * (len(peaks) + 1)
    lift = np.random.default_rng(2).normal(0.0, NOISE.needle_lift, length)
    lift += drift * np.arange(length) / length
    for k, peak in enumerate(peaks):
        lift[1000 + 2000 * k :][:open_for] += stroke(open_for, peak)
    result = lift_figures(Stream().move(lift).observer, STOP)
    return result.at_stop, result.is_to_scale


@pytest.mark.parametrize(("factor", "is_to_scale"), [(1.0, True), (1.02, True), (1.05, False), (0.95, False)])
def test_scale_at_the_stop(factor: float, is_to_scale: bool) -> None:
    at_stop, is_reported_to_scale = figures([factor * STOP] * 8, drift=10e-6)
    assert at_stop == pytest.approx(factor * STOP, rel=0.003)
    assert is_reported_to_scale is is_to_scale


def test_ballistic_or_few_openings_tell_nothing_of_the_stop() -> None:
    assert np.isnan(figures([STOP] * 3)[0])
    at_stop, is_reported_to_scale = figures([0.1e-3] * 8, open_for=40)  # up and down, nowhere still
    assert np.isnan(at_stop)
    assert is_reported_to_scale


def test_openings_that_stay_lower_do_not_count() -> None:
    at_stop, _ = figures([0.1e-3, STOP, 0.15e-3, STOP, STOP, STOP, 0.12e-3, STOP, STOP])
    assert at_stop == pytest.approx(STOP, rel=0.003)


def run(after_closing: NDArray[np.float64]) -> Stream:
    """Stream of openings of 150 samples; after_closing: lift [m] added to the samples from the end of each on."""
    lift = opened(OPENINGS, LENGTH, OPEN_FOR) + np.random.default_rng(11).normal(0.0, NOISE.needle_lift, LENGTH)
    for start in OPENINGS:
        end = start + OPEN_FOR
        lift[end : end + after_closing.size] += after_closing
    return beside_rest(lift)


def open_samples(stream: Stream) -> float:
    return float(np.count_nonzero(stream.rows["seat_area"] > 0.0) / len(OPENINGS))


@pytest.mark.parametrize("creep", [-3 * UM, 1.3 * UM, 2 * UM, 3 * UM])
def test_a_lift_that_has_crept_keeps_no_needle_open(creep: float) -> None:
    stream = run(creep * np.exp(-np.arange(4000) / CREEP_DECAY))
    assert len(stream.injections) == len(OPENINGS)
    assert abs(open_samples(stream) - OPEN_FOR) < 3
    assert abs(float(stream.observer.memory[0]["resting_lift"]["zero"])) < 0.5 * UM
    end = OPENINGS[-1] + OPEN_FOR  # followed at once
    assert np.abs(stream.rows["lift"][end + 20 : end + 500].mean()) < 0.3 * UM


@pytest.mark.parametrize("held", [6 * UM, 12 * UM])
def test_a_needle_held_off_its_seat_is_open(held: float) -> None:
    stream = run(np.full(200, held))
    assert open_samples(stream) > OPEN_FOR + 190


def test_a_needle_that_bounces_is_open_while_it_does() -> None:
    flight = np.linspace(0.0, 1.0, 18)
    stream = run(12 * UM * 4.0 * flight * (1.0 - flight))
    assert open_samples(stream) > OPEN_FOR + 12
    assert abs(float(stream.observer.memory[0]["resting_lift"]["zero"])) < 0.5 * UM
