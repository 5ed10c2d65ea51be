"""Whole simulations: physics against independent figures, noise, quantisation, repeatability."""

import csv
import math
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path

import cantools
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.config.bench import load_injector
from observer_rt.core.model.needle import NeedleStroke
from observer_rt.desk.simulation.plant import Truth, run_plant
from observer_rt.desk.simulation.schedule import Schedule, Shot, make_schedule
from observer_rt.desk.simulation.simulate import (
    LIFT,
    PRESSURE,
    Quantisation,
    SimulatedNoise,
    parse_effects,
    simulate,
    truth_path,
    write_truth,
)
from observer_rt.foundation.errors import UserError
from observer_rt.model.effect import Effect, SizedEffect
from observer_rt.model.effects import VOCABULARY, effective_model, sized

NOMINAL = load_injector()
DENSITY = NOMINAL.fluid.density_nozzle
ONE = make_schedule([100e6], 1, 0.05, [1.1e-3])
NOISE = SimulatedNoise()


def mass(truth: Truth) -> float:
    return float(np.trapezoid(truth.injection_rate, truth.time)) * DENSITY * 1e6


def run(schedule: Schedule = ONE, effects: Sequence[SizedEffect] = (), sample_rate: float = 100e3) -> Truth:
    return simulate(NOMINAL, schedule, sample_rate, effects).truth


@pytest.mark.parametrize(("open_time", "expected"), [(1.9e-3, (77.0, 101.0, 121.0)), (2.4e-3, (98.0, 129.0, 155.0))])
def test_check_masses_of_the_nominal_injector(open_time: float, expected: tuple[float, ...]) -> None:
    """The figures beside the nominal parameters, for a needle that opens and closes in 0.25 ms each."""
    ramp, start = 0.25e-3, 1e-3
    turn, shut, speed = start + open_time - ramp, start + open_time, NOMINAL.seat.max_lift / ramp
    needle = NeedleStroke(start, start + ramp, turn, shut, speed, speed, 0.0, shut, shut)
    time = np.arange(600) / 100e3
    model = effective_model(NOMINAL)
    truths = [run_plant(model, [needle], time, np.full(600, rail)) for rail in (60e6, 100e6, 140e6)]
    assert [mass(truth) for truth in truths] == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("every", [5, 100])
def test_truth_does_not_depend_on_the_sample_rate(every: int) -> None:
    """No shot is missed between slow samples."""
    schedule = make_schedule([100e6], 1, 0.05, shots=[Shot(0.2e-3, 0.7e-3 * i) for i in range(6)])
    fast, slow = run(schedule, sample_rate=100e3), run(schedule, sample_rate=100e3 / every)
    np.testing.assert_allclose(slow.time, fast.time[::every])
    np.testing.assert_allclose(slow.injection_rate, fast.injection_rate[::every], atol=0.001e-6)
    np.testing.assert_allclose(slow.line_pressure, fast.line_pressure[::every], atol=100.0)


def test_a_needle_at_its_stop_changes_the_flow_of_the_pilot_valve() -> None:
    """By a share; the line, once it no longer rings, carries it beside the injection rate."""
    line = NOMINAL.line.model_copy(update={"control_flow": 4e-6, "control_hold": -0.4})
    truth = simulate(NOMINAL.model_copy(update={"line": line}), make_schedule([100e6], 1, 0.05, [12e-3]), 100e3).truth
    at = int(np.searchsorted(truth.time, 0.162))
    drained = (truth.line_flow[at] - truth.injection_rate[at]) / math.sqrt(truth.line_pressure[at] / 100e6)
    assert drained == pytest.approx(2.4e-6, rel=0.01)


def test_a_rising_needle_expels_fuel_through_its_open_pilot_valve() -> None:
    """By its area times its lift, which is not injected, and does not come back as it falls."""

    def drained(expelling: float, displacing: float) -> float:
        areas = {"control_flow": 4e-6, "control_displacement": expelling, "displacement": displacing}
        injector = NOMINAL.model_copy(update={"line": NOMINAL.line.model_copy(update=areas)})
        truth = simulate(injector, make_schedule([100e6], 1, 0.05, [1e-3]), 100e3).truth
        return float((truth.line_flow - truth.injection_rate).sum() / 100e3)

    assert drained(5e-6, 3e-6) - drained(0.0, 0.0) == pytest.approx(5e-6 * NOMINAL.seat.max_lift, rel=0.05)


def test_rest_stays_at_rest() -> None:
    truth = run()
    before = truth.time < 0.15
    assert not truth.injection_rate[before].any()
    assert (truth.sac_pressure[before] == NOMINAL.chamber.pressure).all()
    np.testing.assert_allclose(truth.line_pressure[before], 100e6, rtol=1e-12)
    assert truth.injection_rate[-1] == 0.0


def test_without_noise_the_recording_is_the_truth_plus_sensor_offsets() -> None:
    effects = (sized("line_pressure_sensor_offset", o=0.8e6), sized("rail_pressure_sensor_offset", o=-3e6))
    made = simulate(NOMINAL, ONE, 20e3, effects, measured_rate=True)
    healthy = run(sample_rate=20e3)
    np.testing.assert_array_equal(made.truth.line_pressure, healthy.line_pressure)
    np.testing.assert_array_equal(made.recording.line_pressure, healthy.line_pressure + 0.8e6)
    np.testing.assert_array_equal(made.recording.rail_pressure, healthy.rail_pressure - 3e6)
    np.testing.assert_array_equal(made.recording.needle_lift, healthy.needle_lift)
    assert made.recording.injection_rate is not None
    np.testing.assert_array_equal(made.recording.injection_rate, healthy.injection_rate)
    assert simulate(NOMINAL, ONE, 20e3).recording.injection_rate is None


@pytest.mark.parametrize("sample_rate", [20e3, 100e3])
def test_noise_has_the_stated_size_and_is_white(sample_rate: float) -> None:
    schedule = make_schedule([100e6], 4, 0.2, [1.1e-3])
    made = simulate(NOMINAL, schedule, sample_rate, noise=NOISE, measured_rate=True, seed=1)
    errors = {name: values - getattr(made.truth, name) for name, values in made.recording.signals.items()}
    shut = made.truth.injection_rate == 0.0  # the measured rate's gain error is no noise
    sigmas = {"rail_pressure": 0.1e6, "line_pressure": 0.15e6, "needle_lift": 0.4e-6, "injection_rate": 0.5e-6}
    for name, sigma in sigmas.items():
        error = errors[name][shut]
        allowed = 5 / math.sqrt(error.size)  # five standard deviations of each statistic, or more
        assert error.std() == pytest.approx(sigma, rel=allowed), name
        assert abs(error.mean()) < allowed * sigma, name
        assert abs(np.corrcoef(error[:-1], error[1:])[0, 1]) < allowed, name
    correlations = np.corrcoef([errors[name][shut] for name in sigmas]) - np.eye(len(sigmas))
    assert np.abs(correlations).max() < 5 / math.sqrt(shut.sum())


def test_noisy_signals_lie_on_the_grid_of_the_bus() -> None:
    recording = simulate(NOMINAL, ONE, 20e3, noise=NOISE).recording
    for pressure in (recording.rail_pressure, recording.line_pressure):
        assert not (pressure % 5000.0).any()
    assert np.array_equal(np.rint(recording.needle_lift * 1e8) / 1e8, recording.needle_lift)
    assert (recording.needle_lift < 0.0).any()  # noise round a shut needle is not cut off


def test_measured_rate_has_one_gain_error_per_recording() -> None:
    gains = []
    for seed in range(40):
        made = simulate(NOMINAL, ONE, 20e3, noise=SimulatedNoise(injection_rate=0.0), measured_rate=True, seed=seed)
        assert made.recording.injection_rate is not None
        running = made.truth.injection_rate > 1e-6
        gain = made.recording.injection_rate[running] / made.truth.injection_rate[running]
        assert np.ptp(gain) < 1e-12
        gains.append(gain[0] - 1.0)
    assert 0.003 < np.std(gains) < 0.007
    assert abs(np.mean(gains)) < 0.003


def test_a_seed_gives_the_same_inputs_whether_the_rate_is_measured_or_not() -> None:
    without = simulate(NOMINAL, ONE, 20e3, noise=NOISE, seed=3).recording
    measured = simulate(NOMINAL, ONE, 20e3, noise=NOISE, measured_rate=True, seed=3).recording
    other = simulate(NOMINAL, ONE, 20e3, noise=NOISE, seed=4).recording
    assert not np.array_equal(without.line_pressure, other.line_pressure)
    for name, values in without.signals.items():
        np.testing.assert_array_equal(values, measured.signals[name])


def test_progress_rises_to_one() -> None:
    shares: list[float] = []
    simulate(NOMINAL, ONE, 100e3, progress=shares.append)
    assert shares == sorted(shares)
    assert len(shares) > 1
    assert shares[-1] == 1.0


@pytest.mark.parametrize("sample_rate", [0.0, -1.0, 10.0, 2e6, math.nan])
def test_sample_rates_out_of_range(sample_rate: float) -> None:
    with pytest.raises(UserError, match="--sample-rate"):
        simulate(NOMINAL, ONE, sample_rate)


def test_truth_file(tmp_path: Path) -> None:
    truth = run(sample_rate=20e3)
    path = truth_path(tmp_path / "worn.csv")
    assert path.name == "worn.csv.truth.csv"
    write_truth(path, truth)
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == truth.time.size
    at = int(np.argmax(truth.injection_rate))
    shown = {name: float(value) for name, value in rows[at].items()}
    assert shown == pytest.approx(
        {
            "time_s": truth.time[at],
            "injection_rate_mm3_per_ms": truth.injection_rate[at] * 1e6,
            "needle_lift_mm": truth.needle_lift[at] * 1e3,
            "line_pressure_MPa": truth.line_pressure[at] / 1e6,
            "sac_pressure_MPa": truth.sac_pressure[at] / 1e6,
            "line_flow_mm3_per_ms": truth.line_flow[at] * 1e6,
        },
        rel=1e-11,
    )


DATABASE = cantools.database.load_string((files("observer_rt") / "data/observer_fd.dbc").read_text("utf-8"))
SIGNALS = {signal.name: signal for signal in DATABASE.get_message_by_name("SampleBlock").signals}

QUANTITIES = pytest.mark.parametrize(
    ("quantisation", "signal", "factor"),
    [(PRESSURE, "RailPressure_00", 1e6), (PRESSURE, "LinePressure_00", 1e6), (LIFT, "NeedleLift_00", 1e-6)],
)


@QUANTITIES
def test_every_code_of_the_bus_is_left_as_it_is(quantisation: Quantisation, signal: str, factor: float) -> None:
    codes = np.arange(0xFFFE, dtype=np.float64)
    values = (codes + quantisation.lowest) * quantisation.multiple / quantisation.divisor
    assert np.array_equal(quantisation.apply(values), values)
    shown = np.array([SIGNALS[signal].raw_to_scaled(int(code)) for code in codes], dtype=np.float64)
    np.testing.assert_allclose(values, shown * factor, rtol=1e-14, atol=1e-9 * factor)


@QUANTITIES
@given(value=st.floats(-9.0, 300.0))
def test_values_are_rounded_as_on_a_bus(quantisation: Quantisation, signal: str, factor: float, value: float) -> None:
    (result,) = quantisation.apply(np.array([value * factor]))
    physical = SIGNALS[signal]
    exact = (value - float(physical.offset)) / float(physical.scale)
    if abs(exact % 1.0 - 0.5) > 1e-6:  # ties may fall either way by the last bit of the arithmetic
        assert physical.scaled_to_raw(result / factor) == round(exact)


@QUANTITIES
def test_out_of_range_is_clipped_below_the_error_code(quantisation: Quantisation, signal: str, factor: float) -> None:
    low, high = quantisation.apply(np.array([-1e4, 1e4]) * factor) / factor
    assert low == pytest.approx(float(SIGNALS[signal].offset))
    assert SIGNALS[signal].scaled_to_raw(high) == 0xFFFD


def values(texts: list[str]) -> dict[str, tuple[float, ...]]:
    return {item.effect.id: item.values for item in parse_effects(texts)}


@pytest.mark.parametrize("effect", VOCABULARY.values(), ids=VOCABULARY)
def test_the_whole_vocabulary_to_its_bounds(effect: Effect) -> None:
    for name in ("lowest", "highest"):
        limits = tuple(getattr(parameter, name) for parameter in effect.parameters)
        texts = [f"{effect.id}:{p.name}={getattr(p, name) / p.si!r}" for p in effect.parameters]
        assert values(texts or [effect.id])[effect.id] == pytest.approx(limits)


@pytest.mark.parametrize("size", ["10", "10us", " 10 us"])
def test_a_size_may_have_its_unit(size: str) -> None:
    assert values([f"channel_skew:d={size}"])["channel_skew"] == pytest.approx((10e-6,))


BAD = """orifice_area orifice_area:v_H =0.3 orifice_area:v_S=0.3 orifice_area:=0.3 orifice_area=thirty orifice_area=
    orifice_area=nan orifice_area=-1 seat_outflow=1 guide_leakage=-1e-14 lift_offset=2e-5e lift_offset=80 seat_area=30
    line_pressure_sensor_offset=1e6"""


@pytest.mark.parametrize("text", BAD.split())
def test_bad_effects(text: str) -> None:
    with pytest.raises(UserError, match="--effect: "):
        parse_effects([text])


def test_an_effect_given_twice() -> None:
    with pytest.raises(UserError, match="'seat_area:v_S' is given twice"):
        parse_effects(["seat_area=0.1", "seat_area:v_S=0.2"])
