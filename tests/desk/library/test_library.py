"""The library: recordings in whichever form, injectors, results, discoveries, an observer fed in blocks."""

import copy
import pickle
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import observer_rt as ort
from observer_rt.config.bench import load_bench
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.files.formats import write_recording
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MILLIGRAM, MM3_PER_MS
from observer_rt.model.effects import effective_model

WORN = {"orifice_area": 0.25}
Worn = tuple[Recording, pd.DataFrame]


@pytest.fixture(scope="module")
def worn() -> Worn:
    return ort.simulate(rail_pressure_MPa=[60, 100, 140], energizing_ms=[1.9, 1], injections=6, effects=WORN, seed=3)


@pytest.fixture(scope="module")
def result(worn: Worn) -> ort.EvaluationResult:
    """As the daemon would have it live."""
    return ort.Injector.load().evaluate(worn[0])


def true_masses(truth: pd.DataFrame, injections: pd.DataFrame) -> list[float]:
    density = effective_model(load_bench().injector.parameters).coefficients.density
    masses = []
    for row in injections.itertuples():
        flowing = truth[(truth.time_s >= row.start_s - 1e-3) & (truth.time_s <= row.end_s + 1e-3)]
        volume = np.trapezoid(flowing.injection_rate_mm3_per_ms, flowing.time_s) * MM3_PER_MS
        masses.append(volume * density / MILLIGRAM)
    return masses


def test_import_is_light() -> None:
    code = "import sys, observer_rt; print([n for n in ('numpy', 'pandas', 'scipy', 'rich') if n in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_names_of_the_library_are_there() -> None:
    assert all(callable(getattr(ort, name)) for name in ort.__all__)
    assert set(ort.__all__) <= set(dir(ort))
    with pytest.raises(AttributeError, match="Injektor"):
        ort.Injektor  # noqa: B018


def test_masses_are_those_of_the_command(worn: Worn, result: ort.EvaluationResult) -> None:
    history = evaluate(load_bench(), [worn[0]])
    masses = [report.mass * 1e6 for report in history.evaluations[0].reports]
    np.testing.assert_allclose(result.injections.mass_mg, masses, rtol=1e-12)
    assert len(masses) == 6


@pytest.mark.parametrize("form", ["frame", "arrays", "si", "list"])
def test_every_form_of_a_recording_gives_the_same_masses(
    worn: Worn, result: ort.EvaluationResult, form: str, tmp_path: Path
) -> None:
    recording, frame = worn[0], ort.to_frame(worn[0])
    path = tmp_path / "worn.parquet"
    write_recording(path, recording)
    sources = {
        "frame": frame,
        "arrays": {name: frame[name].tolist() for name in frame},
        "si": recording.arrays,
        "list": [str(path)],
    }[form]
    outcome = ort.Injector.load().evaluate(sources)
    np.testing.assert_allclose(outcome.injections.mass_mg, result.injections.mass_mg, rtol=1e-6)


def test_arrays_need_no_lift_beside_energizing(worn: Worn) -> None:
    without = {name: values for name, values in worn[0].arrays.items() if name != "needle_lift"}
    assert not ort.read({**without, "energizing": np.zeros(worn[0].samples)}).has_lift
    with pytest.raises(ort.UserError, match="needle_lift: has no value at all"):
        ort.Injector.load().evaluate(without)


def test_masses_have_a_budget(worn: Worn, result: ort.EvaluationResult) -> None:
    table, budget = result.injections, result.budget
    total = np.sqrt((budget.filter(like="by_") ** 2).sum(axis=1))
    assert len(budget) == len(table)
    assert (1.96 * total < 1.001 * table.mass_bound_mg).all()  # beside it what the event was published apart by
    np.testing.assert_allclose(table.mass_bound_mg.iloc[-1], 1.96 * total.iloc[-1], rtol=0.2)
    errors = abs(table.mass_mg - true_masses(worn[1], table))[table.valid]
    assert (errors < table.mass_bound_mg[table.valid]).sum() >= 3


def test_what_was_learned_is_a_table_of_curves(result: ort.EvaluationResult) -> None:
    table = result.learned
    assert {*table.flow} == {"orifice_area", "seat_area"}
    drop = table[(table.flow == "orifice_area") & (table.variable == "pressure_drop_MPa")]
    assert drop.value.is_monotonic_increasing
    last = result.injections.iloc[-1]
    np.testing.assert_allclose(drop.change.iloc[-1], last.nozzle_v_H, atol=drop.ci95_halfwidth.iloc[-1])


def test_result_shows_itself(result: ort.EvaluationResult) -> None:
    assert repr(result).startswith("6 injections of 1 recording, ")
    assert "<table" in result._repr_html_()
    assert set(result.trace.state) == {"STARTING", "RUNNING_NOMINAL", "ADAPTED"}
    figure = result.plot(injections=[4])
    assert any("injection 4" in axes.get_title() for axes in figure.axes)
    with pytest.raises(ort.UserError, match=r"^injections: .*no injection 9"):
        result.plot(injections=[9])


def test_learned_state_goes_on(worn: Worn, result: ort.EvaluationResult, tmp_path: Path) -> None:
    path = tmp_path / "learned.state"
    result.save_state(path)
    again = ort.Injector.load().evaluate(worn[0], state=path)
    first, first_again = (each.injections.iloc[0] for each in (result, again))
    assert abs(first_again.remainder_percent) < 1.0
    assert first_again.mass_bound_mg < first.mass_bound_mg
    with pytest.raises(ort.UserError, match="no such file"):
        ort.Injector.load().evaluate(worn[0], state=tmp_path / "other.state")


@pytest.mark.parametrize("block", [61, 5000])
def test_observer_in_blocks_sees_what_evaluate_sees(worn: Worn, result: ort.EvaluationResult, block: int) -> None:
    frame = ort.to_frame(worn[0])
    signals = frame[["rail_pressure_MPa", "needle_lift_mm", "line_pressure_MPa"]].to_numpy()
    if block == 61:  # far enough for the first injection
        signals = signals[:19000]
    observer = ort.Observer(ort.Injector.load())
    parts = [observer.feed(*signals[i : i + block].T) for i in range(0, len(signals), block)]
    seen = pd.concat([*parts, observer.finish()], ignore_index=True)
    expected = result.trace.injection_rate_mm3_per_ms[: len(seen)]
    assert len(seen) >= len(signals) - 16
    np.testing.assert_array_equal(seen.injection_rate_mm3_per_ms[:18000], expected[:18000])
    count = len(observer.injections)
    np.testing.assert_allclose(observer.injections.mass_mg, result.injections.mass_mg[:count])
    assert count == (1 if block == 61 else 6)
    assert repr(observer).startswith(f"Observer at 100000 Hz: {len(signals)} samples, {count} injections, ")
    assert observer.is_valid == (block != 61)


def test_observer_refuses_signals_of_different_length_and_a_sample_rate_by_its_parameter() -> None:
    with pytest.raises(ort.UserError, match=r"\(2,\), \(1,\), \(2,\)"):
        ort.Observer(ort.Injector.load()).feed([100.0, 100.0], 0.0, [100.0, 100.0])
    with pytest.raises(ort.UserError, match=r"^sample_rate_Hz: "):
        ort.Observer(ort.Injector.load(), sample_rate_Hz=float("nan"))


def test_observer_at_work_says_what_to_keep_of_it() -> None:
    rate: Any = np.int64(50_000)
    observer = ort.Observer(ort.Injector.load(), sample_rate_Hz=rate)
    attempts: list[Callable[[Any], Any]] = [pickle.dumps, copy.copy, copy.deepcopy]
    for attempt in attempts:
        with pytest.raises(TypeError, match=r"save_state\(path\)"):
            attempt(observer)


def test_results_are_pickled_whole(
    worn: Worn, result: ort.EvaluationResult, discovery: ort.Discovery, tmp_path: Path
) -> None:
    def copied(outcome: Any) -> Any:
        return pickle.loads(pickle.dumps(outcome))

    path = tmp_path / "worn.parquet"
    write_recording(path, worn[0])
    for evaluated in (result, ort.Injector.load().evaluate(path)):
        again = copied(evaluated)
        pd.testing.assert_frame_equal(again.injections, evaluated.injections)
        pd.testing.assert_frame_equal(again.trace, evaluated.trace)
        assert again.plot(injections=[1]).axes
    outcome = copied(discovery)
    assert repr(outcome) == repr(discovery)
    assert discovery.amended is not None
    assert outcome.amended.parameters == discovery.amended.parameters
    assert copied(ort.Injector.load()) == ort.Injector.load()


def test_injectors_of_the_same_files_are_equal(discovery: ort.Discovery) -> None:
    assert {ort.Injector.load(), ort.Injector.load()} == {ort.Injector.load()}
    assert discovery.amended != ort.Injector.load()


@pytest.mark.parametrize(
    ("arguments", "location", "words"),
    [
        ({"rail_pressure_MPa": -3}, "rail_pressure_MPa", "-3 MPa is out of range"),
        ({"rail_pressure_MPa": []}, "rail_pressure_MPa", "is not a number"),
        ({"energizing_ms": [1.0, -1.0]}, "energizing_ms", "-1.0 ms is out of range"),
        ({"period_ms": 0}, "period_ms", "0 ms is not a period"),
        ({"sample_rate_Hz": 0}, "sample_rate_Hz", "0 Hz is out of range"),
        ({"effects": {"orifice_aria": 0.3}}, "effects", "the nearest is 'orifice_area'"),
        ({"effects": {"nozle": 0.3}}, "effects", "unknown effect 'nozle'\n"),  # to which none is near
        ({"effects": {"orifice_area": {}}}, "effects", "has no '=value'"),
    ],
)
def test_simulate_refuses_by_its_parameters(arguments: dict[str, Any], location: str, words: str) -> None:
    with pytest.raises(ort.UserError, match=f"^{location}: .*{words}"):
        ort.simulate(**arguments)


@pytest.mark.parametrize(("call", "form"), [("evaluate", "layout"), ("discover", "recording"), ("fit", "frame")])
def test_a_line_pressure_that_never_moves_is_refused(worn: Worn, call: str, form: str, tmp_path: Path) -> None:
    dead = worn[0].with_arrays({"line_pressure": np.full(worn[0].samples, 99.3e6)})
    frame = ort.to_frame(dead)
    injector = ort.Injector.load()
    if form == "layout":
        bench = tmp_path / "bench.toml"
        columns = (f'{c.rpartition("_")[0]} = {{column = "{c}", unit = "{c.rpartition("_")[2]}"}}' for c in frame)
        bench.write_text("[recording]\n" + "\n".join(columns))
        injector = ort.Injector.load(bench=bench)
    with pytest.raises(ort.UserError, match=r"line_pressure.*: never moves: it is 99\.3 MPa"):
        getattr(injector, call)(dead if form == "recording" else frame)


@pytest.fixture(scope="module")
def discovery() -> ort.Discovery:
    short, _ = ort.simulate(rail_pressure_MPa=[60, 100, 140], energizing_ms=[1.9, 1.0], injections=3, effects=WORN)
    return ort.Injector.load().discover(short)


def test_discovery_names_effect_and_amends(worn: Worn, discovery: ort.Discovery, tmp_path: Path) -> None:
    assert discovery.verdict == "named"
    (row,) = discovery.effects.itertuples()
    assert row.effect == "orifice_area"
    assert row.low <= 0.25 <= row.high
    amended = discovery.amended
    assert amended is not None
    assert "orifice_area" in repr(amended)
    injections = amended.evaluate(worn[0]).injections
    np.testing.assert_allclose(injections.nominal_mass_mg, true_masses(worn[1], injections), rtol=0.01)
    assert discovery.report(tmp_path / "out").exists()
    assert (tmp_path / "out" / "amended.toml").exists()
    amended.save(tmp_path / "mine.toml")
    assert ort.Injector.load(tmp_path / "mine.toml").parameters == amended.parameters
    assert discovery.proposals.empty


COLUMNS = ("time_s", "rail_pressure_MPa", "needle_lift_mm", "line_pressure_MPa")


@pytest.mark.parametrize(
    ("argument", "error", "words"),
    [
        (3.0, TypeError, "float is no recording"),
        ([3.0], TypeError, "recording 1: float"),
        ([], ort.UserError, "there is none"),
        ("missing.csv", ort.UserError, "missing.csv"),
        (pd.DataFrame({"time_s": [0.0, 1.0]}), ort.UserError, r"1: its headings do not say(?s:.*)by bench=:"),
        (pd.DataFrame(dict.fromkeys(COLUMNS, [0.0, 2e-5, 1e-5] * 99)), ort.UserError, "order of time: it steps back"),
    ],
)
def test_wrong_call_says_what_to_give(argument: object, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        ort.Injector.load().evaluate(argument)


def test_doubt_becomes_a_warning(worn: Worn) -> None:
    arrays, frame = worn[0].arrays, ort.to_frame(worn[0])
    rail, line = arrays["rail_pressure"], arrays["line_pressure"]
    exchanged = frame.assign(rail_pressure_MPa=frame.line_pressure_MPa, line_pressure_MPa=frame.rail_pressure_MPa)
    for recording in ({**arrays, "rail_pressure": line, "line_pressure": rail}, exchanged):
        with pytest.warns(ort.ObserverWarning, match="most likely the two are swapped"):
            ort.Injector.load().evaluate(recording)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ort.Injector.load().evaluate(frame)


def test_what_is_no_path_is_named() -> None:
    nothing: Any = {}
    for parameter in ("path", "bench"):
        with pytest.raises(TypeError, match=f"{parameter}: dict is no path"):
            ort.Injector.load(**{parameter: nothing})


@pytest.mark.slow
def test_fit_gives_an_injector_that_explains_its_recordings(tmp_path: Path) -> None:
    recordings = [
        ort.simulate(rail_pressure_MPa=pressure, energizing_ms=[0.8, 1.6], injections=4, seed=pressure)[0]
        for pressure in (60, 120)
    ]
    start = ort.Injector.load()
    fitted = start.fit(recordings)
    assert start.calibration is None
    assert fitted.calibration is not None
    assert fitted.calibration.adequate
    truth = start.parameters.seat.flow_coefficient
    assert fitted.calibration.parameters.loc["seat.flow_coefficient", "value"] == pytest.approx(truth, rel=0.05)
    fitted.save(tmp_path / "fitted.toml")
    assert ort.Injector.load(tmp_path / "fitted.toml").parameters == fitted.parameters
    assert fitted.calibration.plot().axes
    again = pickle.loads(pickle.dumps(fitted))
    assert (again, repr(again.calibration)) == (fitted, repr(fitted.calibration))
    assert fitted.evaluate(recordings[0], chain=True).valid_share > 0


def test_a_map_of_masses_gives_an_injector(tmp_path: Path) -> None:
    table = tmp_path / "map.csv"
    table.write_text("p_MPa,et_ms,mass_mg\n60,0.4,20\n60,0.8,38.4\n100,0.4,27.7\n100,0.8,49.6\n140,0.8,57.1\n")
    mapped = ort.Injector.load().fit_map(table)
    fit = mapped.map_result
    assert fit is not None
    assert mapped.calibration is None
    value = fit.parameters.value["nozzle.flow_coefficient"]
    assert mapped.parameters.nozzle.flow_coefficient == pytest.approx(value, rel=1e-6)  # of seven digits
    np.testing.assert_allclose(fit.points.fitted_mg, fit.points.mass_mg, rtol=0.03)
    assert "5 masses explained" in repr(fit)
    assert len(fit.plot().axes) == 2
