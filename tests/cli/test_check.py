"""`observer-rt check`: findings for people and programs, and what they do to the exit code."""

import json
from pathlib import Path

import pytest

from tests.cli.conftest import Command


def test_example_bench_has_no_error(command: Command) -> None:
    outcome = command("check")
    assert outcome.code == 0
    assert "steps a sample" in outcome.out
    assert "bus load" in outcome.out


def test_json_document(command: Command, bench: Path) -> None:
    outcome = command("check", "--bench", bench, "--json")
    assert outcome.code == 0
    found = json.loads(outcome.out)
    assert found["schema"] == 1
    assert found["errors"] == 0
    topics = {finding["topic"] for finding in found["findings"]}
    assert {"files", "mapping", "bus load", "integration", "real time"} <= topics


def test_error_found_is_exit_code_1(command: Command, bench: Path) -> None:
    bench.write_text(bench.read_text().replace('message = "SampleBlock"', 'message = "SampleBlok"', 1))
    outcome = command("check", "--bench", bench, "--json")
    assert outcome.code == 1
    found = json.loads(outcome.out)
    assert found["errors"] == 1
    (error,) = (finding for finding in found["findings"] if finding["level"] == "error")
    assert "signals.rail_pressure.message" in error["text"]
    assert "SampleBlock" in error["text"]


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("rate_hz", "rate_hzz", "sampling.rate_hzz: unknown key"),
        ("rate_hz = 50e3", "rate_hz = -1", "sampling.rate_hz"),
        ("injector_id = 1", 'injector_id = "one"', "outputs.injector_id"),
        ("[link]", "[link", "is not valid TOML"),
        ('"observer_fd.dbc"', '"nowhere.dbc"', "nowhere.dbc"),
    ],
)
def test_file_that_must_change(command: Command, bench: Path, old: str, new: str, key: str) -> None:
    text = bench.read_text()
    assert old in text
    bench.write_text(text.replace(old, new, 1))
    outcome = command("run", "--bench", bench)
    assert outcome.code == 2
    assert str(bench.parent) in outcome.err
    assert key in outcome.err
    assert "remedy: " in outcome.err
