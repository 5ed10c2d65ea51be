"""What the shut needle tells: noise of every sensor, offset between line and rail, which x~ follows."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.core.stream.stream import ENOUGH_SAMPLES, FURTHEST_OFFSET
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.engine.estimation.predictor import NoiseLevels, Window
from observer_rt.engine.observer import event_standstill
from observer_rt.engine.stream.standstill import FLOOR, HeldRail, Standstill, offset_between
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.effects import sized
from tests.engine.sample_stream import NOISE, NOMINAL, RAIL, Stream, assert_levels, at_rest, opened

SAMPLES = 3000


@pytest.mark.parametrize(
    "levels", [NoiseLevels(0.1e6, 0.15e6, 0.4e-6), NoiseLevels(0.4e6, 0.05e6, 0.2e-6)], ids=["nominal", "other"]
)
def test_noise_is_measured_within_two_percent(levels: NoiseLevels) -> None:
    random = np.random.default_rng(3)
    stream = Stream(keep=False)
    for _ in range(10):
        stream.feed(*at_rest(random, 10_000, levels))
    assert_levels(stream.standstill.noise, levels, 0.02)


@pytest.mark.parametrize("undone", [0.0, 3.7e-6, -4.4e-6])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.8])
def test_noise_of_a_rail_pressure_between_its_samples_is_that_of_its_samples(share: float, undone: float) -> None:
    """Interpolation takes away its quick part, which the line does not follow anyway; so does a delay [s] undone."""
    random = np.random.default_rng(3)
    stream = Stream(keep=False, stated=(sized("rail_pressure_skew", d=undone),) if undone else ())
    rail = RAIL + random.normal(0.0, 0.1e6, 100_001)
    between = (1.0 - share) * rail[:-1] + share * rail[1:]
    still = np.zeros(100_000)
    noise = stream.feed(between, still, RAIL + random.normal(0.0, 0.15e6, 100_000), rail_share=share).standstill.noise
    assert noise is not None
    assert noise.rail_pressure == pytest.approx(0.1e6, rel=0.02)


@pytest.mark.parametrize("sample_rate", [20e3, 50e3])
def test_noise_is_measured_in_a_ringing_line(sample_rate: float) -> None:
    """Between injections the line swings by megapascals at 1.28 kHz: that is no noise."""
    schedule = make_schedule([100e6, 140e6], 16, 0.05, [1.9e-3])
    made = simulate(NOMINAL, schedule, sample_rate, noise=SimulatedNoise(), seed=4).recording
    stream = Stream(sample_rate=sample_rate, keep=False)
    stream.feed(made.rail_pressure, made.needle_lift, made.line_pressure)
    assert_levels(stream.standstill.noise, NOISE, 0.02)


def test_noise_is_not_stated_before_enough_samples() -> None:
    stream = Stream(keep=False).stay_shut((ENOUGH_SAMPLES - 100) / 100e3)
    assert stream.standstill.noise is None
    assert stream.standstill.samples > ENOUGH_SAMPLES - 1000
    assert stream.stay_shut(1e-2).standstill.noise is not None


def test_noise_has_a_floor() -> None:
    """Signals without any noise: a level of 0 would make every gain meaningless."""
    noise = Stream(keep=False).stay_shut(0.2).standstill.noise
    assert noise == NoiseLevels(rail_pressure=0.01e6, line_pressure=0.01e6, needle_lift=0.02e-6)


def test_open_needle_is_no_standstill() -> None:
    stream = Stream(keep=False).stay_shut(10e-3)
    before = stream.standstill.samples
    pressure = np.full(5000, RAIL)
    stream.feed(pressure, np.full(5000, 0.3e-3), pressure + 30e6)
    assert stream.standstill.samples == pytest.approx(before, abs=10)
    assert abs(stream.standstill.offset) < 1e-12


def test_measured_noise_replaces_the_stated_only_where_it_contradicts_it() -> None:
    """From a few milliseconds on a level three times too low is seen, one that is right stays to the last digit."""
    random = np.random.default_rng(3)
    stream = Stream(learning=True)
    for _ in range(2):
        rail, lift, line = at_rest(random, 4000, replace(NOISE, rail_pressure=3 * NOISE.rail_pressure))
        stream.feed(rail, lift + opened([800], 4000), line)
    noise = event_standstill(stream.observer, 0).noise
    assert noise is not None
    assert noise.line_pressure == pytest.approx(NOISE.line_pressure, rel=1e-12)
    assert noise.needle_lift == pytest.approx(NOISE.needle_lift, rel=1e-12)
    assert noise.rail_pressure == pytest.approx(3 * NOISE.rail_pressure, rel=0.15)


@pytest.mark.parametrize("factor", [2.0, 0.5])
def test_noise_that_changes_is_followed_from_event_to_event(factor: float) -> None:
    random = np.random.default_rng(3)
    stream = Stream(learning=False)
    for k in range(10):
        times = factor if k >= 5 else 1.0
        rail, lift, line = at_rest(random, 6000, replace(NOISE, rail_pressure=times * NOISE.rail_pressure))
        stream.feed(rail, lift + opened([500], 6000), line)
    levels = [event_standstill(stream.observer, k).noise for k in range(10)]
    result = [level.rail_pressure / NOISE.rail_pressure for level in levels if level is not None]
    assert result[:5] == pytest.approx([1.0] * 5, rel=0.02)
    assert result[6:] == pytest.approx([factor] * 4, rel=0.08)


def offset_after(difference: float, is_coloured: bool = False) -> float:
    """Of x~ [Pa] after 30 ms in which the line pressure is recorded by so much [Pa] too high."""
    random, stream = np.random.default_rng(2), Stream(keep=False)
    stream.observer.memory["judgement"]["offset_moves"] = not is_coloured
    rail, lift, line = at_rest(random, SAMPLES)
    stream.feed(rail, lift, line).feed(rail, lift, line + difference)
    return float(stream.observer.memory[0]["pair"]["offset"]) * stream.observer.constants.coefficients.pressure_scale


@pytest.mark.parametrize("difference", [0.0, 0.8 * MEGAPASCAL, -1.2 * MEGAPASCAL])
def test_offset_follows(difference: float) -> None:
    assert offset_after(difference) == pytest.approx(difference, abs=0.03 * MEGAPASCAL)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_no_offset_of_a_good_sensor_is_not_followed(sign: float) -> None:
    assert abs(offset_after(sign * 5.0 * MEGAPASCAL)) <= FURTHEST_OFFSET


def test_what_moves_on_and_on_is_followed_no_further() -> None:
    stream = Stream(keep=False)
    rail = np.full(20_000, RAIL)
    stream.feed(rail, np.zeros(20_000), rail + np.linspace(0.0, 5.0 * MEGAPASCAL, 20_000))
    scale = stream.observer.constants.coefficients.pressure_scale
    assert stream.observer.memory[0]["pair"]["offset"] * scale == pytest.approx(FURTHEST_OFFSET)


def test_slow_noise_is_not_followed() -> None:
    assert offset_after(0.8 * MEGAPASCAL, is_coloured=True) == 0.0


@pytest.mark.parametrize(
    ("rail_every", "noise", "moved", "is_held"),
    [
        (1.0, NOISE, 0, True),
        (1.5, NOISE, 0, False),
        (1.0, FLOOR, 0, False),
        (1.0, NOISE, 1, False),
        (1.0, NOISE, 50, False),
    ],
    ids=["held", "slow", "computed", "moves in the event", "moves between events"],
)
def test_a_rail_pressure_as_a_set_value(rail_every: float, noise: NoiseLevels, moved: int, is_held: bool) -> None:
    """A slow one, or one of a computed recording, may be the same in an event. moved: samples, in every event."""
    held, window = HeldRail(), Window(np.full((50, 2), 0.95), np.zeros(50), np.zeros(50, np.bool_), np.zeros(4), 25)
    for event in range(3):
        window.inputs[50 - moved :, 0] += 1e-3
        held = held.after(window, Standstill(1000, 0.0, noise), rail_every)
        assert held.is_held == (is_held and event > 0)


def test_the_offset_is_the_mean_since_the_event_before() -> None:
    first, second = Standstill(1000, 0.01, None), Standstill(3000, 0.03, None)
    assert offset_between(None, Standstill(0, 0.0, None)) is None
    assert offset_between(None, first) == pytest.approx(0.01)
    assert offset_between(first, second) == pytest.approx(0.04)
    assert offset_between(second, second) is None
