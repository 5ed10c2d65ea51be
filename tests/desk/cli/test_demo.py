"""The demonstration: what it shows is right."""

from pathlib import Path

import pytest

from tests.desk.cli.conftest import Command


@pytest.mark.parametrize("option", ["--out demo", "--outside", "--missing-effect --wear 0.2"])
def test_an_option_of_the_other_demonstration_is_refused(command: Command, option: str) -> None:
    assert "--missing-effect" in command.refused("demo", *option.split())


def test_command_prints_the_table_and_writes_the_figure(command: Command, tmp_path: Path) -> None:
    figure = tmp_path / "demo.png"
    done = command.done("demo", "--injections", 4, "--speed", 0.5, "--figure", figure)
    rows = [line.split() for line in done.out.splitlines()[2:]]
    assert ([row[0] for row in rows], [row[-1] for row in rows]) == (["1", "2", "3", "4"], ["yes"] * 4)
    assert [float(row[3]) for row in rows] == pytest.approx([-20.5] * 4, abs=1.5)  # nominal model, percent
    assert max(abs(float(row[6])) for row in rows) < 1.0  # observer
    assert max(map(len, done.out.splitlines())) <= 80
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert str(figure) in done.err
