"""`observer-rt check`: findings for people and programs, and what they do to the exit code."""

import json
from pathlib import Path

import pytest

from observer_rt.config.bench import NOMINAL_INJECTOR
from tests.desk.cli.conftest import Command


def test_example_bench_has_no_error(command: Command) -> None:
    outcome = command.done("check")
    assert "steps a sample" in outcome.out
    assert "bus load" in outcome.out


def test_json_document(command: Command, bench: Path) -> None:
    outcome = command.done("check", "--bench", bench, "--json")
    found = json.loads(outcome.out)
    assert found["schema"] == 1
    assert found["errors"] == 0
    topics = {finding["topic"] for finding in found["findings"]}
    assert {"files", "mapping", "bus load", "integration", "real time"} <= topics


def test_effects_in_force_are_named(command: Command, bench: Path, tmp_path: Path) -> None:
    injector = tmp_path / "amended.toml"
    size = '{ value = 20.0, unit = "um" }'
    entry = f'\n[[effects]]\nid = "lift_offset"\nparameters = {{ x_0 = {size} }}\n'
    injector.write_text(NOMINAL_INJECTOR.read_text() + entry)
    found = {}
    for model in (NOMINAL_INJECTOR, injector):
        outcome = command("check", "--bench", bench, "--model", model, "--json")
        findings = json.loads(outcome.out)["findings"]
        found[model] = {finding["topic"]: finding["text"] for finding in findings}
    assert found[injector]["effects"] == "lift_offset x_0 = 20 um"
    assert "effects" not in found[NOMINAL_INJECTOR]
    assert found[injector]["look-ahead"] != found[NOMINAL_INJECTOR]["look-ahead"]


def test_a_learned_state_is_looked_at_and_left_alone(command: Command, bench: Path, tmp_path: Path) -> None:
    state = tmp_path / "learned.json"
    state.write_text('{"version": 1}')
    outcome = command.done("check", "--bench", bench, "--state", state, "--json")
    (finding,) = (f for f in json.loads(outcome.out)["findings"] if f["topic"] == "learned state")
    assert finding["level"] == "warning"
    assert "format is version 1" in finding["text"]
    assert [path.name for path in tmp_path.glob("learned*")] == ["learned.json"]


@pytest.mark.parametrize(("unit", "likely"), [("10 MPa", "which is likely bar"), ("bar", "MPa, read as bar")])
def test_a_log_in_another_unit_is_an_error(
    command: Command, bench: Path, worn: Path, tmp_path: Path, unit: str, likely: str
) -> None:
    """As `evaluate` refuses it."""
    log = tmp_path / "bus.log"
    command.done("convert", worn, log, "--bench", bench)
    command.done("check", "--bench", bench, "--log", log)
    pattern = 'pattern = "LinePressure_{:02d}"'
    bench.write_text(bench.read_text().replace(pattern, f'{pattern}\nunit = "{unit}"'))
    checked = command("check", "--bench", bench, "--log", log)
    assert checked.code == 1
    assert likely in " ".join(checked.out.split())
    assert likely in command.refused("evaluate", log, "--bench", bench)
