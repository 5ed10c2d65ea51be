"""Commands on a recording without needle lift: those that learn the needle, and those that refuse it."""

from pathlib import Path

import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_injector
from tests.desk.cli.conftest import Command, document


def test_it_is_evaluated_and_what_needs_the_lift_says_so(tmp_path: Path, command: Command) -> None:
    path, bench = tmp_path / "no_lift.csv", tmp_path / "bench.toml"
    bench.write_text(command("run", "--print-example-bench").out)
    command.done("simulate", "--injections", 2, "--no-lift", "--effect", "orifice_area:v_H=0.3", "--output", path)
    of_file = document(command, path)["recordings"][0]
    assert "needle_lift_zero" not in {check["id"] for check in of_file["checks"]}
    for injection in of_file["injections"]:
        assert injection["valid"]
        assert injection["mass_mg"] == pytest.approx(1.26 * injection["nominal_mass_mg"], rel=0.02)
        assert ("needle_closes_later" in injection["indicators"]) > (
            "needle_lift_sensor_lag" in injection["indicators"]
        )
    for words in (
        ("discover", path, "--out", tmp_path / "found"),
        ("convert", path, path.with_suffix(".log"), "--bench", bench),
    ):
        outcome = command(*words)
        assert outcome.code == 2
        assert f"{path}, needle_lift: was not recorded" in outcome.err.replace("\n", "")


@pytest.mark.slow
def test_a_fit_finds_needle_and_line(tmp_path: Path, command: Command) -> None:
    text, own, fitted = NOMINAL_INJECTOR.read_text(), tmp_path / "own.toml", tmp_path / "fitted.toml"
    for before, after in (("0.32e-3", "0.36e-3"), ("0.27e-3", "0.19e-3"), ("loss_factor = 8", "loss_factor = 9")):
        assert text.count(before) == 1
        text = text.replace(before, after)
    own.write_text(text)
    paths = [tmp_path / f"{pressure}.csv" for pressure in (60, 100, 140)]
    for seed, path in enumerate(paths):
        point = "--rail-pressure", path.stem, "--energizing-time", "0.7,1.2,1.8", "--injections", 6, "--seed", seed
        command.done("simulate", "--model", own, "--no-lift", *point, "--output", path)
    said = command.done("fit", *paths, "--model", NOMINAL_INJECTOR, "--output", fitted)
    assert "known only as its product with the needle's opening speed" in " ".join(said.err.split())
    injector, true = load_injector(fitted), load_injector(own)
    assert injector.baseline is not None
    assert injector.baseline.adequate
    assert injector.needle.opening_delay == pytest.approx(true.needle.opening_delay, abs=8e-6)
    assert injector.needle.closing_delay == pytest.approx(true.needle.closing_delay, abs=8e-6)
    assert injector.line.loss_factor == pytest.approx(true.line.loss_factor, rel=0.02)
    assert injector.nozzle.flow_coefficient == pytest.approx(true.nozzle.flow_coefficient, rel=0.005)
