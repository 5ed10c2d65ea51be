"""Commands on a recording without needle lift: one evaluates it, others refuse it."""

from pathlib import Path

import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR
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
        ("fit", path, "--model", NOMINAL_INJECTOR, "--output", path.with_suffix(".toml")),
        ("discover", path, "--out", tmp_path / "found"),
        ("convert", path, path.with_suffix(".log"), "--bench", bench),
    ):
        outcome = command(*words)
        assert outcome.code == 2
        assert f"{path}, needle_lift: was not recorded" in outcome.err.replace("\n", "")
