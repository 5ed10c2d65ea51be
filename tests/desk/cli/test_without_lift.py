"""Commands on a recording without needle lift: those that learn the needle, and those that refuse it."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from tests.desk.cli.conftest import Command, document


def test_it_is_evaluated_and_what_needs_the_lift_says_so(tmp_path: Path, command: Command) -> None:
    path, bench, log = tmp_path / "no_lift.csv", tmp_path / "bench.toml", tmp_path / "no_lift.log"
    bench.write_text(command("run", "--print-example-bench").out)
    command.done("simulate", "--injections", 2, "--no-lift", "--effect", "orifice_area:v_H=0.3", "--output", path)
    of_file = document(command, path)["recordings"][0]
    assert "needle_lift: not measured" in command.done("check", "--recording", path).out
    assert "needle_lift_zero" not in {check["id"] for check in of_file["checks"]}
    for injection in of_file["injections"]:
        assert injection["valid"]
        assert injection["mass_mg"] == pytest.approx(1.26 * injection["nominal_mass_mg"], rel=0.02)
        assert "needle_closes_later" in injection["indicators"]
        assert "needle_lift_sensor_lag" not in injection["indicators"]
    outcome = command("convert", path, log, "--bench", bench)
    assert outcome.code == 2
    assert f"{path}, needle_lift: was not recorded" in outcome.err.replace("\n", "")


LAYOUT = """
[recording.time]
column = "time_s"
unit = "s"
[recording.rail_pressure]
column = "rail_pressure_MPa"
unit = "MPa"
[recording.line_pressure]
column = "line_pressure_MPa"
unit = "MPa"
[recording.energizing]
column = "coil_A"
factor = 0.25
"""


def test_a_coil_current_serves_for_the_level(tmp_path: Path, command: Command) -> None:
    """Peak and hold, from 2 A on: some 30 us late at the beginning, and 90 us at the end, which is learned."""
    path, measured, bench = tmp_path / "level.csv", tmp_path / "current.csv", tmp_path / "bench.toml"
    points = "--rail-pressure", "60,120", "--energizing-time", "0.6,1.4", "--injections", 4
    command.done("simulate", *points, "--no-lift", "--output", path)
    table = pd.read_csv(path)
    level, current, since = table.pop("energizing").to_numpy(), np.zeros(len(table)), 0
    for n in range(1, len(table)):
        since = since + 1 if level[n] else 0
        aim = 18.0 if since < 35 else 9.0
        current[n] = min(current[n - 1] + 0.8, aim) if since else 0.85 * current[n - 1]
    table["coil_A"] = current + np.random.default_rng(1).normal(0.0, 0.1, len(table))
    table.to_csv(measured, index=False)
    bench.write_text(command("run", "--print-example-bench").out + LAYOUT)
    by_level, by_current = (
        [injection["mass_mg"] for injection in document(command, *words)["recordings"][0]["injections"]]
        for words in ((path,), (measured, "--bench", bench))
    )
    assert by_current == pytest.approx(by_level, rel=0.005)


def test_its_injections_are_compared_with_a_test_plan(tmp_path: Path, command: Command) -> None:
    path, plan = tmp_path / "no_lift.csv", tmp_path / "plan.csv"
    points = "--rail-pressure", "60,120", "--energizing-time", "0.7,1.4", "--injections", 4
    command.done("simulate", *points, "--no-lift", "--effect", "orifice_area:v_H=0.3", "--output", path)
    plan.write_text("p [bar];ET [us];mass [mg];tolerance [%]\n600;700;32,2;8\n1200;1400;140;8\n900;700;40;8\n")
    worn, wide, none = document(command, path, "--map", plan)["map"]
    assert (worn["injections"], worn["verdict"]) == (2, "outside")
    assert worn["mass_mg"] > 1.2 * worn["stated_mg"]
    assert (wide["injections"], none["injections"], none["mass_mg"]) == (2, 0, None)
    text = command.done("evaluate", path, "--map", plan).out
    assert "beside the map" in text
    assert "1 of 3 points have no valid injection" in text
    plan.write_text("p [bar];ET [us];mass\n600;700;40\n")
    assert f"{plan}, line 1: 'mass': no unit" in command.refused("evaluate", path, "--map", plan)


POINTS = "--rail-pressure", "60,100,140", "--energizing-time", "0.6,1.9", "--injections", 6


@pytest.mark.slow
def test_a_needle_that_bounces_is_named(tmp_path: Path, command: Command) -> None:
    """By a parabola of 60 us, which is no half sine from the landing on."""
    path, answer = tmp_path / "bounce.csv", tmp_path / "found"
    command.done("simulate", *POINTS, "--no-lift", "--jitter", 8, "--bounce", 25, "--output", path)
    command.done("discover", path, "--out", answer)
    (effect,) = load_injector(answer / "amended.toml").effects
    assert effect.id == "needle_bounce"
    assert 15.0 < effect.parameters["b"].value < 25.0


@pytest.mark.slow
def test_a_needle_that_answers_late_is_named_and_enters_the_model(tmp_path: Path, command: Command) -> None:
    path, answer = tmp_path / "late.csv", tmp_path / "found"
    late = "--no-lift", "--jitter", 8, "--effect", "closing_delay:d=60"
    command.done("simulate", *POINTS, *late, "--output", path)
    command.done("discover", path, "--out", answer)
    (effect,) = load_injector(answer / "amended.toml").effects
    low, high = effect.parameters["d"].ci95 or (0.0, 0.0)
    assert effect.id == "closing_delay"
    assert low < 60.0 < high < low + 28.0
    late_by = [
        document(command, path, "--model", model)["recordings"][0]["injections"][-1]["indicators"]
        for model in (NOMINAL_INJECTOR, answer / "amended.toml")
    ]
    nominal, amended = (1e6 * indicators["needle_closes_later"]["value"] for indicators in late_by)
    assert nominal - amended == pytest.approx(60.0, abs=8.0)


@pytest.mark.slow
def test_a_fit_finds_needle_and_nozzle(tmp_path: Path, command: Command) -> None:
    own, fitted = tmp_path / "own.toml", tmp_path / "fitted.toml"
    own.write_text(NOMINAL_INJECTOR.read_text().replace("0.32e-3", "0.36e-3").replace("0.27e-3", "0.19e-3"))
    paths = [tmp_path / "60.csv", tmp_path / "140.csv"]
    for path in paths:
        point = "--rail-pressure", path.stem, "--energizing-time", "0.7,1.2,1.8", "--injections", 3
        command.done("simulate", "--model", own, "--no-lift", *point, "--output", path)
    command.done("fit", *paths, "--model", NOMINAL_INJECTOR, "--output", fitted)
    injector = load_injector(fitted)
    assert getattr(injector.baseline, "adequate", False)
    sizes = [injector.needle.opening_delay, injector.needle.closing_delay, 1e-3 * injector.nozzle.flow_coefficient]
    assert sizes == pytest.approx([0.36e-3, 0.19e-3, 0.78e-3], abs=8e-6)
