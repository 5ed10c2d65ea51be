"""The command line in this process: arguments in, exit code and both outputs back."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from observer_rt.config.bench import EXAMPLE_BENCH, exact_text
from observer_rt.desk.cli.app import main
from observer_rt.files.formats import write_recording
from tests.device import simulated

NOTHING: Mapping[str, str] = {}


class Outcome(NamedTuple):
    code: int
    out: str
    err: str


class Command:
    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self._monkeypatch, self._capsys = monkeypatch, capsys

    def __call__(self, *arguments: object) -> Outcome:
        """Run it with these arguments; whatever the user did wrong, never a traceback."""
        self._monkeypatch.setattr(sys, "argv", ["observer-rt", *map(str, arguments)])
        self._capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main()
        out, err = self._capsys.readouterr()
        assert "Traceback" not in out + err
        code = end.value.code
        assert code is None or isinstance(code, int)
        return Outcome(code or 0, out, err)

    def done(self, *arguments: object) -> Outcome:
        outcome = self(*arguments)
        assert outcome.code == 0, f"{arguments}\n{outcome.err}\n{outcome.out}"
        return outcome

    def refused(self, *arguments: object) -> str:
        outcome = self(*arguments)
        assert outcome.code == 2, f"{arguments}\n{outcome.err}\n{outcome.out}"
        return outcome.err


@pytest.fixture(autouse=True)
def hang_up_counts() -> None:
    """As without nohup, whatever these tests are started by."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Command:
    return Command(monkeypatch, capsys)


def module(
    *arguments: object, stdout: int = subprocess.PIPE, environment: Mapping[str, str] = NOTHING
) -> "subprocess.Popen[str]":
    words = [sys.executable, "-m", "observer_rt", *map(str, arguments)]
    return subprocess.Popen(words, stdout=stdout, stderr=subprocess.PIPE, text=True, env=os.environ | environment)


def document(command: Command, *arguments: object) -> dict[str, Any]:
    printed = command.done("evaluate", *arguments, "--json").out
    parsed: dict[str, Any] = json.loads(printed, parse_constant=lambda name: pytest.fail(name))
    return parsed


@pytest.fixture(scope="session")
def worn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recording of a worn nozzle: four events at 50 kHz with noise and a measured rate."""
    path = tmp_path_factory.mktemp("worn") / "worn.csv"
    write_recording(path, simulated(4, 0.3, (60e6, 120e6), seed=3, measured_rate=True))
    return path


@pytest.fixture(scope="session")
def resting(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("resting") / "resting.csv"
    rows = [f"{k * 1e-5:.5f},60,0,60" for k in range(2000)]
    path.write_text("time_s,rail_pressure_MPa,needle_lift_mm,line_pressure_MPa\n" + "\n".join(rows) + "\n")
    return path


@pytest.fixture
def bench(tmp_path: Path) -> Path:
    text = exact_text(EXAMPLE_BENCH)
    text = text.replace('"socketcan"', '"virtual"').replace("rate_hz = 100e3", "rate_hz = 50e3")
    path = tmp_path / "bench.toml"
    path.write_text(text)
    return path
