"""Recordings through the observer: traces and results against the truth and against each other."""

import copy
import csv
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_bench, load_injector
from observer_rt.desk.evaluation.evaluate import History, evaluate
from observer_rt.desk.simulation.schedule import Shot, energized, make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, Simulation, simulate
from observer_rt.engine.stream.state import Reason
from observer_rt.files.signals.recording import shown_slowly
from observer_rt.foundation.errors import UserError
from observer_rt.model.effective import coefficients
from observer_rt.model.effects import sized
from tests.desk.evaluation.documents import recording_json, screen_text

BENCH = load_bench().exact
NOMINAL = load_injector()
C = coefficients(NOMINAL)


@cache
def worn() -> Simulation:
    schedule = make_schedule([100e6], 4, 0.05, [1.1e-3])
    effects = (sized("orifice_area", v_H=0.3),)
    return simulate(NOMINAL, schedule, 50e3, effects, SimulatedNoise(), measured_rate=True, seed=2)


@cache
def evaluated() -> History:
    return evaluate(BENCH, [worn().recording])


@pytest.mark.parametrize("sample_rate", [50e3, 100e3])
def test_healthy_injector_without_noise_is_estimated_exactly(sample_rate: float) -> None:
    """Root mean square error of 0.3 mm3/ms or less over the windows, pilot and post included."""
    shots = [Shot(0.4e-3, -1.5e-3), Shot(1.1e-3, 0.0), Shot(0.4e-3, 2.5e-3)]
    schedule = make_schedule([60e6, 140e6], 4, 0.05, shots=shots)
    made = simulate(NOMINAL, schedule, sample_rate)
    (evaluation,) = evaluate(BENCH, [made.recording], learning=False).evaluations
    error = (evaluation.trace.injection_rate - made.truth.injection_rate) / 1e-6
    for report in evaluation.reports:
        window = error[report.start_index : report.end_index + 1]
        assert np.sqrt(np.mean(window**2)) <= 0.3
    assert [report.event for report in evaluation.reports] == [1] * 3 + [2] * 3 + [3] * 3 + [4] * 3


def test_open_loop_rate_is_the_balance_of_state_and_phi() -> None:
    """From the columns of the trace alone: Q_H,model(x^) - (V_L p0/K_L) phi_1."""
    (evaluation,) = evaluated().evaluations
    trace = evaluation.trace
    some = ~np.isnan(trace.injection_rate)
    x3, phi1 = trace.x[some, 2], trace.phi[some, 0]
    drop = x3 * NOMINAL.scaling.pressure
    area = NOMINAL.nozzle.flow_coefficient * NOMINAL.nozzle.area
    model = area * np.sqrt(2 / NOMINAL.fluid.density_nozzle) * drop / np.sqrt(np.hypot(drop, 0.5e6))
    stored = NOMINAL.line.volume * NOMINAL.scaling.pressure / NOMINAL.fluid.bulk_modulus_line
    expected = model - stored * phi1
    np.testing.assert_allclose(trace.open_loop_rate[some], expected, rtol=1e-9, atol=1e-15)
    assert np.abs(phi1).max() * stored > 5e-6  # m3/s: phi carries the wear


@pytest.mark.parametrize("meter", [(), (0.2e-3,)])
def test_results_of_the_injections(meter: tuple[float, ...]) -> None:
    """Masses from trace and measurement over the window stated, in the units stated; a meter may be late."""
    recording = worn().recording
    measured = recording.signals["injection_rate"]
    shown = shown_slowly(measured, 1 / 50e3, *meter)
    (evaluation,) = evaluate(BENCH, [replace(recording, injection_rate=shown, meter=meter)]).evaluations
    for result in recording_json(evaluation, C)["injections"]:
        inside = (recording.time >= result["start_s"] - 1e-9) & (recording.time <= result["end_s"] + 1e-9)
        to_mg = 1 / 50e3 * NOMINAL.fluid.density_nozzle * 1e6
        for key, rate in (
            ("mass_mg", evaluation.trace.corrected_rate),
            ("live_mass_mg", evaluation.trace.injection_rate),
            ("predicted_mass_mg", evaluation.trace.open_loop_rate),
            ("nominal_mass_mg", evaluation.trace.nominal_rate),
            ("measured_mass_mg", measured),
        ):
            exact = 3e-3 if meter and rate is measured else 1e-9
            assert result[key] == pytest.approx(float(np.trapezoid(rate[inside])) * to_mg, rel=exact)
        share = 1.0 + 0.01 * result["remainder_percent"]
        assert result["mass_mg"] == pytest.approx(share * result["predicted_mass_mg"], rel=1e-9)
        error = (shown_slowly(evaluation.trace.corrected_rate[inside], 1 / 50e3, *meter) - shown[inside]) / 1e-6
        assert result["rate_rmse_mm3_per_ms"] == pytest.approx(float(np.sqrt(np.mean(error**2))))
        assert result["rail_pressure_MPa"] == pytest.approx(100.0, abs=0.6)


@pytest.mark.parametrize("reason", [Reason.OUTSIDE_LEARNED_RANGE, Reason.TOO_FEW_EVENTS])
def test_what_would_help_an_injection_outside_what_was_learned_is_said_of_no_other(reason: Reason) -> None:
    evaluation = copy.copy(evaluated().evaluations[0])
    *before, last = evaluation.injections
    evaluation.injections = [*before, replace(last, valid=False, reason=reason)]
    text = screen_text(evaluation, C)
    assert f"not valid for {reason.name}: {len(before) + 1}" in text
    assert ("record some as short or as long" in text) is (reason is Reason.OUTSIDE_LEARNED_RANGE)


def test_without_a_measurement_nothing_is_compared_with_it() -> None:
    made = simulate(NOMINAL, make_schedule([100e6], 2, 0.05, [1.1e-3]), 20e3, noise=SimulatedNoise())
    (evaluation,) = evaluate(BENCH, [made.recording]).evaluations
    for result in recording_json(evaluation, C)["injections"]:
        assert (result["measured_mass_mg"], result["rate_rmse_mm3_per_ms"]) == (None, None)
        assert result["mass_mg"] > 0.0


@pytest.mark.parametrize(("offset", "passed"), [(0.0, True), (1e6, True), (3e6, False), (-3e6, False)])
def test_standstill_check_of_the_offset(offset: float, passed: bool) -> None:
    effects = (sized("line_pressure_sensor_offset", o=offset),)
    made = simulate(NOMINAL, make_schedule([100e6], 1, 0.05, [1.1e-3]), 20e3, effects, SimulatedNoise())
    (evaluation,) = evaluate(BENCH, [made.recording], learning=False).evaluations
    checks = {check["id"]: check for check in recording_json(evaluation, C)["checks"]}
    assert checks["rail_line_offset"]["value"] == pytest.approx(offset / 1e6, abs=0.02)
    assert checks["rail_line_offset"]["unit"] == "MPa"
    assert checks["rail_line_offset"]["passed"] is passed
    assert "needle_lift_noise" in checks
    evaluation.has_lift = False
    assert len(recording_json(evaluation, C)["checks"]) == 3  # the offset, and two pressures' noise


@pytest.mark.parametrize(("factor", "unit"), [(100.0, "ms"), (0.025, "not s")])
def test_a_rate_beyond_those_observed_is_refused(factor: float, unit: str) -> None:
    recording = worn().recording
    with pytest.raises(UserError, match=f"is sampled at(?s:.*) {unit}$"):
        evaluate(BENCH, [recording.with_arrays({"time": recording.time * factor})])


def test_missing_samples_are_counted_and_left_out() -> None:
    """Three milliseconds of a dead sensor: not available, and back soon after."""
    recording = worn().recording
    line = recording.line_pressure.copy()
    line[9000:9150] = np.nan
    damaged = type(recording)(recording.time, recording.rail_pressure, recording.needle_lift, line)
    (evaluation,) = evaluate(BENCH, [damaged]).evaluations
    assert evaluation.counters.lost_samples == 150
    assert np.isnan(evaluation.trace.injection_rate[9000:9300]).all()
    assert not evaluation.trace.valid[9000:9300].any()
    assert not np.isnan(evaluation.trace.injection_rate[9302:]).any()


@pytest.mark.parametrize(
    ("dies", "noise"), [(0.14, 0.3e-6), (0.3, 0.0), (0.37, 0.0), (0.37, 0.3e-6), (0.14, np.nan), (0.37, np.nan)]
)
def test_a_lift_that_dies_is_left_out_for_the_commands(dies: float, noise: float) -> None:
    schedule = make_schedule([100e6], 5, 0.06, [0.8e-3])
    seen = simulate(NOMINAL, schedule, 50e3, (), SimulatedNoise(), seed=8).recording
    sound = replace(seen, energizing=energized(schedule, seen.time))
    still = noise * np.random.default_rng(1).normal(size=seen.time.size)
    lift = np.where(seen.time < dies, seen.needle_lift, still)
    dead, alive = (evaluate(BENCH, [each]).evaluations[0] for each in (replace(sound, needle_lift=lift), sound))
    assert (dead.lift_failed, alive.lift_failed) == (True, False)
    assert [each.mass for each in dead.reports] == pytest.approx([each.mass for each in alive.reports], rel=0.02)
    assert "the needle goes by the commands" in screen_text(dead, C)


def test_trace_file(tmp_path: Path) -> None:
    (evaluation,) = evaluated().evaluations
    path = tmp_path / "trace.csv"
    evaluate(BENCH, [evaluation.source], traces=[path])
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == [
        *("time_s", "injection_rate_mm3_per_ms", "injection_rate_sigma_mm3_per_ms"),
        *("corrected_rate_sigma_mm3_per_ms", "corrected_rate_mm3_per_ms", "nominal_rate_mm3_per_ms"),
        *("open_loop_rate_mm3_per_ms", "valid", "state", "x1", "x2", "x3", "phi1", "phi2", "phi3"),
    ]
    assert len(rows) == worn().recording.samples
    assert (rows[0]["injection_rate_mm3_per_ms"], rows[0]["valid"], rows[0]["state"]) == ("", "0", "STARTING")
    at = int(np.nanargmax(evaluation.trace.injection_rate))
    for name in ("injection_rate", "injection_rate_sigma", "corrected_rate_sigma", "corrected_rate", "nominal_rate"):
        assert float(rows[at][f"{name}_mm3_per_ms"]) == pytest.approx(evaluation.trace[name][at] / 1e-6, rel=1e-8)
    assert float(rows[at]["x3"]) == pytest.approx(evaluation.trace.x[at, 2], rel=1e-8)
    assert float(rows[at]["phi1"]) == pytest.approx(evaluation.trace.phi[at, 0], rel=1e-8)
    assert float(rows[at]["time_s"]) == pytest.approx(worn().recording.time[at], rel=1e-8)
    assert (rows[-1]["state"], rows[-1]["valid"]) == ("ADAPTED", "1")


JUDGED = slice(3, 10)
NOMINAL_ERRORS = {0.3: -0.21, -0.3: 0.38, 0.0: 0.0}  # of the model that knows nothing of the wear


@pytest.mark.parametrize("v_h", [0.3, -0.3, 0.0])
def test_mass_and_rate(v_h: float) -> None:
    schedule = make_schedule([100e6], 10, 0.06, [1.9e-3])
    made = simulate(load_injector(), schedule, 50e3, (sized("orifice_area", v_H=v_h),), SimulatedNoise(), seed=7)
    (evaluation,) = evaluate(load_bench().exact, [made.recording]).evaluations
    density = load_injector().fluid.density_nozzle
    assert [result.valid for result in evaluation.injections] == [True] * 10
    live: list[float] = []
    corrected: list[float] = []
    for result in evaluation.injections:
        window = slice(result.start_index, result.end_index + 1)
        true_rate = made.truth.injection_rate[window]
        true_mass = np.trapezoid(true_rate) / 50e3 * density
        nominal_error = result.nominal_mass / true_mass - 1
        assert nominal_error == pytest.approx(NOMINAL_ERRORS[v_h], abs=0.02)
        assert result.mass == pytest.approx(true_mass, rel=0.005 if live else 0.012)  # the first one
        assert abs(result.mass - float(true_mass)) < result.mass_bound
        live.append(np.mean((evaluation.trace.injection_rate[window] - true_rate) ** 2))
        corrected.append(np.mean((evaluation.trace.corrected_rate[window] - true_rate) ** 2))
    assert np.sqrt(np.mean(live[JUDGED])) / 1e-6 <= 1.0
    assert np.sqrt(np.mean(corrected)) / 1e-6 <= 0.8


def test_a_line_pressure_clipped_at_rest_is_never_valid_and_wrong() -> None:
    """Its range ends below most rail pressures: what such a rest shows is no offset of the sensor."""
    random = np.random.default_rng(6)
    rails, durations = random.uniform(40e6, 158e6, 8), random.uniform(0.5e-3, 2e-3, 8)
    schedule = make_schedule(rails.tolist(), 8, 0.06, durations.tolist())
    made = simulate(NOMINAL, schedule, 100e3, (sized("orifice_area", v_H=0.15),), SimulatedNoise(), seed=6)
    clipped = replace(made.recording, line_pressure=np.minimum(made.recording.line_pressure, 102e6))
    (evaluation,) = evaluate(BENCH, [clipped]).evaluations
    for report in (one for one in evaluation.reports if one.valid):
        window = slice(report.start_index, report.end_index + 1)
        truth = np.sum(made.truth.injection_rate[window]) / 100e3 * C.density
        assert report.mass == pytest.approx(truth, rel=0.02)


@pytest.mark.parametrize("law", ["-20[1/s] * time", "-0.21 * (injection_number - 1)"])
def test_the_nominal_model_counts_as_the_observer_does(law: str, tmp_path: Path) -> None:
    file = tmp_path / "injector.toml"
    stated = f'\n[[terms]]\nequation = "nozzle_flow"\nlaw = "{law}"\n'
    file.write_text(NOMINAL_INJECTOR.read_text("utf-8") + stated, "utf-8")
    (evaluation,) = evaluate(load_bench(model=file), [worn().recording], learning=False).evaluations
    np.testing.assert_array_equal(evaluation.trace.nominal_rate, evaluation.trace.open_loop_rate)
