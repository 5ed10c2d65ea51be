"""The systemd unit: what it starts exists, and it is watched as the service tells."""

import configparser
import shlex
from pathlib import Path

import typer.main

from observer_rt.desk.cli.app import app

UNIT = Path(__file__).parents[2] / "tools" / "systemd" / "observer-rt.service"


class _Unit(configparser.RawConfigParser):
    """Keys may be repeated and keep their case."""

    def __init__(self) -> None:
        super().__init__(strict=False, delimiters=("=",), comment_prefixes=("#",))

    def optionxform(self, optionstr: str) -> str:
        return optionstr


def unit() -> _Unit:
    parser = _Unit()
    parser.read(UNIT)
    return parser


def test_it_starts_a_command_with_options_that_there_are() -> None:
    program, name, *arguments = shlex.split(unit()["Service"]["ExecStart"])
    assert Path(program).name == "observer-rt"
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    known = {option for parameter in commands[name].params for option in parameter.opts}
    assert {argument for argument in arguments if argument.startswith("--")} <= known


def test_it_waits_for_ready_watches_and_restarts_but_not_for_a_wrong_bench_file() -> None:
    service = unit()["Service"]
    assert service["Type"] == "notify"
    assert service["WatchdogSec"] == "10s"
    assert service["Restart"] == "always"
    assert service["RestartPreventExitStatus"] == "2"


def test_its_sandbox_lets_can_through() -> None:
    service = unit()["Service"]
    assert "AF_CAN" in service["RestrictAddressFamilies"]
