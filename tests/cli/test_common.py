"""What holds for every command."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from observer_rt import __version__
from tests.cli.conftest import Command, module


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
    process = module("evaluate", resting, "--json")
    out, err = process.communicate()
    assert process.returncode == 0, err
    assert json.loads(out)["recordings"][0]["samples"] == 2000


def test_as_a_module_mistake_of_the_user() -> None:
    process = module("evaluate", "nowhere.csv")
    said = "error: nowhere.csv: no such file or folder\n  remedy: check the path\n"
    assert process.communicate() == ("", said)
    assert process.returncode == 2


def test_results_that_cannot_be_written() -> None:
    with Path("/dev/full").open("w") as full:
        process = module("run", "--print-example-bench", stdout=full.fileno())
        _, err = process.communicate()
    assert (process.returncode, err) == (1, "error: output: No space left on device\n")


def test_reader_that_goes_away() -> None:
    with module("run", "--print-example-bench") as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == ""
        assert process.wait() == 1


# Python imports a module of this name, if there is one, before anything else.
HOOK = """
import sys
class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == "{module}":
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupting())
"""


@pytest.mark.parametrize("name", ["typer", "observer_rt.config.bench", "numba", "observer_rt.service.rights"])
def test_ctrl_c_while_modules_are_imported(tmp_path: Path, name: str) -> None:
    (tmp_path / "sitecustomize.py").write_text(HOOK.format(module=name))
    path = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    done = subprocess.run(
        [sys.executable, "-m", "observer_rt", "check"],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")
