"""The systemd unit, also as a template: what it starts exists, and it is watched as the service tells."""

import configparser
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
import typer.main

from observer_rt.desk.cli.app import app_of

UNIT = Path(__file__).parents[2] / "tools" / "systemd" / "observer-rt.service"


def unit() -> configparser.RawConfigParser:
    """Keys may be repeated and keep their case."""
    parser = configparser.RawConfigParser(strict=False, delimiters=("=",), comment_prefixes=("#",))
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(UNIT)
    return parser


def test_it_starts_a_command_with_options_that_there_are() -> None:
    program, name, *arguments = shlex.split(unit()["Service"]["ExecStart"])
    assert Path(program).name == "observer-rt"
    commands = typer.main.get_command(app_of()).commands  # type: ignore[attr-defined]
    options = {option for parameter in commands[name].params for option in parameter.opts}
    assert {each.partition("=")[0] for each in arguments if each.startswith("--")} <= options


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd is not installed")
@pytest.mark.parametrize("name", ["observer-rt.service", "observer-rt@.service"])
def test_systemd_finds_nothing_wrong_with_it(tmp_path: Path, name: str) -> None:
    """Alone, and as a template for the injectors of a bench."""
    program = shlex.split(unit()["Service"]["ExecStart"])[0]
    (tmp_path / name).write_text(UNIT.read_text().replace(program, "/bin/true"))
    command = ["systemd-analyze", "verify", "--man=no", str(tmp_path / name.replace("@", "@left"))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
