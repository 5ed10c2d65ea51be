"""What holds for every command."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from observer_rt import __version__
from tests.cli.conftest import Command


def test_help_fits_80_columns(command: Command) -> None:
    outcome = command.done("--help")
    assert max(map(len, outcome.out.splitlines())) <= 80


def test_version(command: Command) -> None:
    assert command("--version").out == f"observer-rt {__version__}\n"


@pytest.mark.parametrize(
    "arguments",
    [("nosuch",), ("evaluate",), ("evaluate", "x.csv", "--bogus"), ("replay", "x.csv", "--speed", "fast")],
)
def test_wrong_command_line(command: Command, arguments: tuple[str, ...]) -> None:
    outcome = command(*arguments)
    assert outcome.code == 2
    assert outcome.out == ""
    assert "Error: " in outcome.err


def test_as_a_module_results_and_messages_apart(resting: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "observer_rt", "evaluate", str(resting), "--json"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["recordings"][0]["samples"] == 2000


def test_as_a_module_mistake_of_the_user() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "observer_rt", "evaluate", "nowhere.csv"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr == "error: nowhere.csv: no such file or folder\n  remedy: check the path\n"


def test_results_that_cannot_be_written() -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "observer_rt", "run", "--print-example-bench"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 1
    assert done.stderr == "error: output: No space left on device\n"


def test_reader_that_goes_away() -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "observer_rt", "run", "--print-example-bench"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait() == 1
