"""With the true effect in its file the observer is right from the first injection, on a plant of other code."""

import numpy as np
import pytest

from observer_rt.core.stream.stream import REACH
from observer_rt.engine.estimation.parameters import NOZZLE, OFFSET, SEAT
from observer_rt.engine.observer import Durations, constants_for
from observer_rt.engine.stream.state import samples_ahead
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import seen_in, sized
from tests.engine.plant_runs import GATED, indicator, run_plant, with_effects
from tests.engine.sample_stream import NOMINAL, Stream
from tests.observed_plants import ObservedRun
from tests.plants.laws import Laws
from tests.plants.parameters import Faults

UM = 1e-6
HIDDEN = {
    "eroded": (Faults(orifice_area=0.3), sized("orifice_area", v_H=0.3)),
    "coked": (Faults(orifice_area=-0.3), sized("orifice_area", v_H=-0.3)),
    "worn seat": (Faults(seat_area=0.3), sized("seat_area", v_S=0.3)),
    "leak": (Faults(guide_leakage=3e-14), sized("guide_leakage", c=3e-14)),
    "friction": (Faults(line_friction=2.0), sized("line_friction", k=2.0)),
    "seat outflow": (Faults(seat_outflow=1.0), sized("seat_outflow")),
    "stiffer": (Faults(bulk_modulus=0.2), sized("bulk_modulus", r=0.2)),
    "volume": (Faults(line_volume=-0.2), sized("line_volume", r=-0.2)),
    "stiffening": (Faults(bulk_modulus_slope=5.0), sized("pressure_dependent_bulk_modulus", n=5.0)),
    "air": (Faults(entrained_air=4e-3), sized("entrained_air", g=4e-3)),
    "dense": (Faults(fuel_density=0.05), sized("fuel_density", r=0.05)),
    "cavitation": (Faults(orifice_cavitation=0.12), sized("orifice_cavitation", n_crit_excess=0.12)),
    "seat coefficient": (
        Faults(seat_lift_loss=0.3, seat_lift_scale=60e-6),
        sized("lift_dependent_seat_coefficient", a=0.3, x_c=60e-6),
    ),
    "chamber": (Faults(chamber_pressure_step=5e6), sized("chamber_pressure_rise", dp=5e6)),
    "chamber, needle": (Faults(chamber_pressure_rise=8e6), sized("chamber_pressure_rise", dp=8e6, s=1.0)),
    "lift too low": (Faults(lift_offset=20e-6), sized("lift_offset", x_0=20e-6)),
    "lift too high": (Faults(lift_offset=-20e-6), sized("lift_offset", x_0=-20e-6)),
    "lift gain": (Faults(lift_gain=0.1), sized("lift_gain", g=0.1)),
    "rail gain": (Faults(rail_pressure_sensor_gain=0.02), sized("rail_pressure_sensor_gain", g=0.02)),
    "rail offset": (Faults(rail_pressure_sensor_offset=-3e6), sized("rail_pressure_sensor_offset", o=-3e6)),
    "lag": (Faults(line_pressure_sensor_lag=40e-6), sized("line_pressure_sensor_lag", tau=40e-6)),
    "line offset": (Faults(line_pressure_sensor_offset=3e6), sized("line_pressure_sensor_offset", o=3e6)),
    "late": (Faults(channel_skew=27e-6), sized("channel_skew", d=27e-6)),
}
SERVO = sized("control_flow", c=4e-6, d_on=44e-6, d_off=-16e-6)  # of the plant's valve
EVENTS = 6


def test_the_whole_vocabulary_is_tested() -> None:
    """But for what the bench file says of the bench, and a needle whose lift is not recorded."""
    of_the_injector = {effect.id for effect in seen_in(has_lift=True) if not effect.remedy}
    assert {effect.effect.id for _, effect in [*HIDDEN.values(), (None, SERVO)]} == of_the_injector


def live_error(run: ObservedRun) -> float:
    """Relative error of the first injection's live rate, before anything was learned."""
    return float(run.reports[0].live_mass / run.true[0] - 1.0)


def test_a_servo_injector_is_right_from_the_first_injection() -> None:
    run = run_plant(Faults(), EVENTS, stated=SERVO, laws=Laws(control_flow=4e-6))
    assert abs(live_error(run)) < 0.004
    assert np.abs(run.errors).max() < 0.01
    assert all(report.valid for report in run.reports)


@pytest.mark.parametrize(("faults", "effect"), HIDDEN.values(), ids=HIDDEN)
def test_right_from_the_first_injection_and_not_learned_again(faults: Faults, effect: SizedEffect) -> None:
    """Terms are relative to the model in force."""
    run = run_plant(faults, EVENTS, stated=effect)
    assert abs(live_error(run)) < 0.004
    assert np.abs(run.errors).max() < 0.01
    assert all(run.valid)
    for name in GATED:
        assert indicator(run, name).value == 0.0
    assert abs(indicator(run, NOZZLE).value) < 0.02
    assert abs(indicator(run, SEAT).value) < 0.03
    assert abs(indicator(run, OFFSET).value) < 0.02e6


@pytest.mark.parametrize("name", ["eroded", "lift too low", "rail offset", "line offset"])
def test_without_it_the_first_injection_is_wrong(name: str) -> None:
    """So that the tests above can fail. From p_L alone a line offset looks like the rail's: that one is not valid."""
    run = run_plant(HIDDEN[name][0], EVENTS)
    is_learned = abs(indicator(run, NOZZLE).value) > 0.02 or abs(live_error(run)) > 0.02
    assert is_learned or not any(report.valid for report in run.reports)


def lookahead(*effects: SizedEffect) -> int:
    return constants_for(with_effects(NOMINAL, *effects), 100e3, Durations(), events_required=2).timing.lookahead


def test_look_ahead_grows_only_where_it_is_needed() -> None:
    usual = samples_ahead(1e-5)
    assert lookahead() == usual
    assert lookahead(sized("lift_offset", x_0=-20 * UM), sized("channel_skew", d=20e-6)) == usual
    assert lookahead(sized("lift_offset", x_0=20 * UM)) > usual + 2
    assert lookahead(sized("channel_skew", d=55e-6)) == 5 + REACH
    assert lookahead(sized("channel_skew", d=-55e-6)) == usual


def with_lift_too_low(offset: float) -> Stream:
    """At rest, the offset of the lift [m] in force."""
    return Stream(injector=with_effects(NOMINAL, sized("lift_offset", x_0=offset))).stay_shut(5e-3)


@pytest.mark.parametrize("speed", [0.5, 0.8, 1.1])
@pytest.mark.parametrize("offset", [6 * UM, 20 * UM, 45 * UM])
@pytest.mark.parametrize("phase", [0.0, 0.4, 0.9])
def test_ramps_are_extended_to_where_the_needle_is_at_its_seat(speed: float, offset: float, phase: float) -> None:
    """Straight ramps at `speed` [m/s]; of the lift only what exceeds the offset is recorded."""
    rise = speed * 1e-5
    time = np.arange(140) - 30 - phase
    lift = np.clip(rise * np.minimum(time, 80 - time), 0.0, 300 * UM)
    stream = with_lift_too_low(offset).move(np.maximum(lift - offset, 0.0)).stay_shut(2e-3)
    sample_stream = Stream().stay_shut(5e-3).move(lift).stay_shut(2e-3)
    instants = np.linspace(0.0, 139.0, 139 * 20 + 1)
    result, expected = (
        np.maximum(np.interp(instants, np.arange(140), s.rows["seat_area"][500:640]), 0.0)
        for s in (stream, sample_stream)
    )
    # to a fifth of a sample of the ramp
    np.testing.assert_allclose(result, expected, atol=0.2 * expected.max() * rise / lift.max())
    assert [each.count("counts", "injections_begun") for each in (stream, sample_stream)] == [1, 1]


def test_noise_behind_the_recorded_end_of_a_ramp_is_no_part_of_it() -> None:
    """Above half the dead band it would keep the needle open, and the toe would be led on with next to no slope."""
    lift = np.clip(8 * UM * np.minimum(np.arange(140) - 30.0, 110.0 - np.arange(140)), 0.0, 300 * UM)
    recorded = np.maximum(lift - 20 * UM, 0.0)
    end = int(np.flatnonzero(recorded)[-1])
    recorded[end + 2 : end + 9 : 2] = 1.4 * UM
    area = with_lift_too_low(20 * UM).move(recorded).stay_shut(2e-3).rows["seat_area"][500:640]
    assert np.flatnonzero(area > 0.0)[-1] == np.flatnonzero(lift)[-1]


def test_a_needle_that_does_not_open_has_no_toe() -> None:
    stream, random = with_lift_too_low(20 * UM), np.random.default_rng(3)
    for _ in range(20):
        stream.move(random.normal(0.0, 0.4 * UM, 10_000))
    assert stream.count("event", "number") == 0
    assert not (stream.rows["seat_area"] > 0.0).any()
