"""Injectors on every line there is, through the commands; and lines that cannot be computed, refused."""

import re
from pathlib import Path

import numpy as np
import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR, load_bench
from observer_rt.desk.check.findings import Level
from observer_rt.desk.check.observer import observer_findings
from observer_rt.identification.fit.fitted_file import BASELINE
from tests.desk.cli.conftest import Command, document
from tests.desk.cli.injector_files import FITTED, injector


def test_a_line_of_two_parts_is_simulated_and_observed(command: Command, tmp_path: Path) -> None:
    model = injector(tmp_path / "injector.toml", "wave_two_part", "seat")
    made = tmp_path / "made.csv"
    points = ("--rail-pressure", "60,140", "--energizing-time", 1.1, "--injections", 4)
    command.done("simulate", "--model", model, *points, "--output", made)
    (recording_document,) = document(command, made, "--model", model)["recordings"]
    assert [injection["valid"] for injection in recording_document["injections"]] == [True] * 4
    rate = np.loadtxt(f"{made}.truth.csv", delimiter=",", skiprows=1)[:, 1]
    for injection in recording_document["injections"]:
        first = injection["start_index"]
        true = np.sum(rate[first - 100 : first + 1000]) * 0.01 * 0.83  # 0.01 ms, 0.83 mg/mm3
        assert injection["mass_mg"] == pytest.approx(true, rel=0.01)


def test_too_many_cells_are_refused_with_the_numbers(command: Command, resting: Path, tmp_path: Path) -> None:
    model = injector(tmp_path / "injector.toml", "wave", added="cells = 40\n")
    said = " ".join(command.refused("evaluate", resting, "--model", model).split())
    assert "line.cells: 40 cells are not stable: sound crosses 3.21 of a cell in a step of 10 us" in said
    assert "(at most 0.98)" in said
    match = re.search(r"give (\d+) cells, or leave 'cells' out", said)
    assert match is not None
    assert command("check", "--model", model).code == 1
    model.write_text(model.read_text().replace("cells = 40", f"cells = {match[1]}"))
    command.done("check", "--model", model)


def test_what_cannot_be_integrated_is_not_looked_at_further(tmp_path: Path) -> None:
    model = injector(tmp_path / "injector.toml", "wave", added="cells = 40\n")
    findings = observer_findings(load_bench(model=model).exact.injector)
    assert [(one.topic, one.level) for one in findings] == [("integration", Level.ERROR)]


@pytest.mark.parametrize(
    ("adequate", "rate", "said"),
    [
        ("false", 1e5, "injector.toml was found inadequate by its own fit: nothing is learned, and no injection is"),
        ("true", 2e4, "injector.toml was fitted at 20000 Hz and is not comparable at 100000 Hz"),
        ("true", 1e5, None),
    ],
)
def test_a_fit_that_will_not_do_is_told_at_once(
    command: Command, resting: Path, tmp_path: Path, adequate: str, rate: float, said: str | None
) -> None:
    model = injector(tmp_path / "injector.toml", end=FITTED.format(adequate=adequate, rate=rate))
    evaluated = command.done("evaluate", resting, "--model", model)
    lines = [line for line in evaluated.err.splitlines() if line.startswith("warning")]
    (checked,) = (
        one for one in observer_findings(load_bench(model=model).exact.injector) if one.topic == "fitted model"
    )
    if said is None:
        assert lines == []
        assert checked.level is Level.OK
    else:
        assert [said in line for line in lines] == [True]
        assert checked.level is Level.WARNING
        assert said in checked.text


def test_the_keys_of_the_printed_example_are_those_of_a_fitted_file(tmp_path: Path) -> None:
    """Uncommented, they load."""
    text = NOMINAL_INJECTOR.read_text()
    for key in (
        "line_outflow",
        "model",
        "cells",
        "damping",
        "end_volume",
        "inlet_loss_factor",
        "wall_viscosity",
        "impedance_ratio",
        "impedance_step",
    ):
        assert f"# {key} = " in text
        text = text.replace(f"# {key} = ", f"{key} = ")
    path = tmp_path / "injector.toml"
    path.write_text(text.replace('model = "lump"', 'model = "wave_two_part"'))
    loaded = load_bench(model=path).injector.parameters
    assert (loaded.line.model, loaded.line.cells) == ("wave_two_part", 8)
    assert f"[{BASELINE}]" in text
