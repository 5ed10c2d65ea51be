"""What a shut needle shows in its lift is no motion: zero, noise and what the line pressure adds."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.core.stream.stream import MAX_EVENT
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, Simulation, simulate
from observer_rt.engine.stream.standstill import RestingLift
from observer_rt.engine.stream.state import Reason, State
from tests.engine.sample_stream import NOISE, NOMINAL, RAIL, Stream, beside_rest, opened

MS = 100  # samples at 100 kHz
UM = 1e-6
OPENINGS = range(1000, 40_000, 3000)


def lift_of(openings: range, length: int, noise: float = NOISE.needle_lift, seed: int = 4) -> NDArray[np.float64]:
    return opened(openings, length) + np.random.default_rng(seed).normal(0.0, noise, length)


TIME = np.arange(45_000) / 100e3
DRIFTS = {
    "3 um at 1.5 Hz": 3 * UM * np.sin(2 * np.pi * 1.5 * TIME),
    "10 um at 1 Hz": 10 * UM * np.sin(2 * np.pi * TIME),
    "30 um": 30 * UM * TIME / TIME[-1],
    "too high from the start": np.full(TIME.size, 8 * UM),
    "too low from the start": np.full(TIME.size, -8 * UM),
}


@pytest.mark.parametrize("drift", DRIFTS.values(), ids=DRIFTS.keys())
def test_zero_is_followed(drift: NDArray[np.float64]) -> None:
    still = lift_of(OPENINGS, TIME.size)
    stream = beside_rest(still + drift)
    assert len(stream.injections) == len(OPENINGS)
    rows = stream.rows
    assert rows["valid"][1000:].all()
    plain = beside_rest(still).rows["seat_area"]
    is_open = plain > 0.1
    errors = rows["seat_area"][is_open] / plain[is_open] - 1.0
    assert np.abs(errors).max() < 0.02
    assert np.abs(errors.mean()) < 0.003


@pytest.mark.parametrize(
    ("first_zero", "zero"),
    [(35, 35), (35, 30), (-35, -35), (35, 0), (-35, 0), (-20, -10), (35, -5)],
    ids=lambda um: f"{um} um",
)
def test_zero_of_before_is_a_start(first_zero: float, zero: float) -> None:
    """Where the needle rests elsewhere after a restart, it is found there, as without it; the line rings."""
    lift = lift_of(OPENINGS, TIME.size) + zero * UM
    rail = RAIL + np.random.default_rng(9).normal(0.0, NOISE.rail_pressure, lift.size)
    line = rail + 3e6 * np.sin(2 * np.pi * 1e3 * TIME)
    stream = Stream(events_required=0, lift=RestingLift(zero=first_zero * UM)).feed(rail, lift, line)
    result = [i["opening_index"] for i in stream.injections]
    assert result[-len(OPENINGS) + 1 :] == pytest.approx(list(OPENINGS)[1:], abs=3)
    if first_zero == zero:
        assert (result[0], len(result)) == (pytest.approx(OPENINGS[0], abs=3), len(OPENINGS))


def test_zero_does_not_follow_an_open_needle() -> None:
    """One that sticks at 8 um after its closing stays open until it is found to be stuck; then nothing is sure."""
    lift = lift_of(range(1000, 1001), 3000 + 2 * MAX_EVENT)
    lift[1110:] += 8 * UM
    lift[1090:1110] = np.maximum(lift[1090:1110], 8 * UM)
    rows = beside_rest(lift).rows
    assert (rows["seat_area"][1100 : 1000 + MAX_EVENT] > 0.0).all()
    stuck = np.flatnonzero(rows["reason"] == Reason.NEEDLE_STUCK)
    assert stuck[0] == pytest.approx(1000 + MAX_EVENT, abs=5)
    assert not rows["valid"][stuck[0] :].any()


def test_needle_open_from_the_start_is_no_zero() -> None:
    rows = beside_rest(np.full(2 * MAX_EVENT, 300 * UM)).rows
    assert (rows["reason"][MAX_EVENT + 10 :] == Reason.NEEDLE_STUCK).all()
    assert np.isnan(rows["injection_rate"]).all()


def test_low_lift_that_stays_from_the_start_is_of_a_shut_needle() -> None:
    """In a line as full as the rail: the openings are found, and an event must pass before they are valid."""
    stream = beside_rest(lift_of(range(2000, 30_000, 5000), 30_000) + 30 * UM)
    assert [i["opening_index"] for i in stream.injections][-5:] == pytest.approx(range(7000, 30_000, 5000), abs=3)
    assert abs(float(stream.observer.memory[0]["resting_lift"]["zero"]) - 30 * UM) < 0.5 * UM
    assert not stream.rows["valid"][:4000].any()
    assert stream.rows["valid"][-1]


def test_lift_that_moves_at_the_start_is_no_zero() -> None:
    """A closing at the very beginning, at lifts that a zero might have."""
    lift = lift_of(range(0), 3000)
    lift[:120] += np.linspace(14 * UM, 0.0, 120)
    stream = beside_rest(lift)
    assert abs(float(stream.observer.memory[0]["resting_lift"]["zero"])) < 0.5 * UM
    assert np.isnan(stream.rows["injection_rate"][: 3 * MS]).all()


STEP_AT = 5500  # between two openings


def stepped(fall: float) -> Stream:
    """A lift that steps by 25 um between two openings and stays there; the line pressure falls [Pa] as it does."""
    lift = lift_of(OPENINGS, TIME.size)
    lift[STEP_AT:] += 25 * UM
    return beside_rest(lift, fall, STEP_AT)


def test_lift_that_steps_in_a_line_at_rest_is_of_a_shut_needle() -> None:
    """A connection that moved: the next openings are found, where it would have been stuck for good."""
    stream = stepped(0.0)
    assert [i["opening_index"] for i in stream.injections] == pytest.approx(list(OPENINGS), abs=20)
    rows = stream.rows
    assert not (rows["reason"] == Reason.NEEDLE_STUCK).any()
    is_open = rows["seat_area"][STEP_AT + 4 * MS :] > 0.1
    plain = beside_rest(lift_of(OPENINGS, TIME.size)).rows["seat_area"][STEP_AT + 4 * MS :] > 0.1
    assert np.mean(is_open != plain) < 0.002


def test_needle_that_opens_a_little_and_stays_is_open() -> None:
    stream = stepped(3e6)
    assert not stream.rows["valid"][STEP_AT:].any()
    assert (stream.rows["seat_area"][STEP_AT + 4 * MS :] > 0.0).all()
    assert stream.rows["reason"][-1] == Reason.NEEDLE_STUCK


def test_zero_that_leaves_its_limit_makes_nothing_valid() -> None:
    drift = 60 * UM * np.clip((TIME - 0.05) / 0.1, 0.0, 1.0) * (TIME < 0.3)
    rows = beside_rest(lift_of(range(0), TIME.size) - drift).rows
    beyond = rows[int(0.14e5) : int(0.29e5)]
    assert (beyond["reason"] == Reason.LIFT_ZERO).all()
    assert (beyond["state"] == State.DEGRADED).all()
    assert rows["valid"][: int(0.1e5)][MS + 1 :].all()


@pytest.mark.parametrize("factor", [1.0, 3.0, 6.0])
def test_noise_beyond_the_stated_opens_nothing(factor: float) -> None:
    """The dead band is that of the noise there is, a few milliseconds after the start."""
    stream = beside_rest(lift_of(OPENINGS, 45_000, factor * NOISE.needle_lift))
    assert len(stream.injections) == len(OPENINGS)
    band = max(5 * factor * NOISE.needle_lift, 2 * UM)
    assert float(stream.observer.memory[0]["dead_band"]["lift_on"]) == pytest.approx(band, rel=0.1)


def test_band_follows_noise_that_grows() -> None:
    """Coloured noise, too, which differences of neighbours hardly show."""
    random = np.random.default_rng(5)
    noise = np.zeros(100_000)
    for k in range(1, noise.size):
        noise[k] = 0.7 * noise[k - 1] + random.normal(0.0, 0.3 * UM * (1.0 + 4.0 * k / noise.size))
    stream = beside_rest(noise)
    assert stream.count("counts", "injections_begun") == 0
    assert float(stream.observer.memory[0]["dead_band"]["lift_on"]) > 5 * np.std(noise[-20_000:]) * 0.8


@cache
def ringing() -> Simulation:
    return simulate(NOMINAL, make_schedule([RAIL], 12, 0.05, [1.4e-3, 0.8e-3]), 100e3, noise=SimulatedNoise(), seed=4)


def observed(crosstalk: float, loud: slice = slice(0), first_crosstalk: float = 0.0) -> Stream:
    """With crosstalk of the line pressure into the lift [m/Pa]; loud: in another unit; first_crosstalk: initial."""
    made = ringing().recording
    lift = made.needle_lift + crosstalk * (made.line_pressure - made.rail_pressure)
    lift[loud] *= 1000.0
    before = RestingLift(crosstalk=first_crosstalk)
    return Stream(events_required=0, lift=before).feed(made.rail_pressure, lift, made.line_pressure)


@pytest.mark.parametrize("crosstalk", [0.15e-12, -0.15e-12, 0.05e-12])
def test_crosstalk_of_the_line_pressure_is_found_and_taken_out(crosstalk: float) -> None:
    stream, plain = observed(crosstalk), observed(0.0)
    result = float(stream.observer.memory[0]["resting_lift"]["crosstalk"]) / 100e6
    assert result == pytest.approx(crosstalk, rel=0.1)
    late = slice(30_000, None)
    difference = stream.rows["lift"][late] - plain.rows["lift"][late]
    assert np.sqrt(np.mean(difference**2)) < 0.1 * UM
    more = stream.count("counts", "injections_begun") - plain.count("counts", "injections_begun")
    assert more <= 4  # until it is known


def test_crosstalk_of_before_is_taken_out_at_once() -> None:
    stream, plain = observed(0.3e-12, first_crosstalk=0.3e-12), observed(0.0)
    result = float(stream.observer.memory[0]["resting_lift"]["crosstalk"]) / 100e6
    assert result == pytest.approx(0.3e-12, rel=0.1)
    assert stream.count("counts", "injections_begun") == plain.count("counts", "injections_begun")
    assert observed(0.3e-12).count("counts", "injections_begun") > plain.count("counts", "injections_begun")


def test_crosstalk_of_before_that_no_opening_shows_is_forgotten() -> None:
    stream = observed(0.0, first_crosstalk=0.3e-12)
    assert float(stream.observer.memory[0]["resting_lift"]["crosstalk"]) == 0.0
    late = stream.rows["lift"][30_000:] - observed(0.0).rows["lift"][30_000:]
    assert np.abs(late).max() < 0.5 * UM


@pytest.mark.parametrize("loud", [slice(0), slice(12_000, 32_000)], ids=["none", "another unit"])
def test_a_lift_without_crosstalk_is_left_alone(loud: slice) -> None:
    assert float(observed(0.0, loud).observer.memory[0]["resting_lift"]["crosstalk"]) == 0.0
