"""`observer-rt check`: findings for people and programs, and what they do to the exit code."""

import json
from pathlib import Path

from tests.desk.cli.conftest import Command


def test_json_document(command: Command, bench: Path) -> None:
    outcome = command.done("check", "--bench", bench, "--json")
    content = json.loads(outcome.out)
    assert (content["schema"], content["errors"]) == (1, 0)
    topics = {finding["topic"] for finding in content["findings"]}
    assert {"files", "mapping", "bus load", "integration", "real time"} <= topics


def test_a_log_in_another_unit_is_an_error(command: Command, bench: Path, worn: Path, tmp_path: Path) -> None:
    likely = "MPa, if read as bar"
    log = tmp_path / "bus.log"
    command.done("convert", worn, log, "--bench", bench)
    command.done("check", "--bench", bench, "--log", log)
    pattern = 'pattern = "LinePressure_{:02d}"'
    bench.write_text(bench.read_text().replace(pattern, f'{pattern}\nunit = "bar"'))
    checked = command("check", "--bench", bench, "--log", log)
    assert checked.code == 1
    assert likely in " ".join(checked.out.split())
    assert likely in command.refused("evaluate", log, "--bench", bench)
