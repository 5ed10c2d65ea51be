"""The demonstration: what it shows came over a bus, and is right."""

from pathlib import Path

import pytest

from observer_rt.desk.demonstration.worn import Demo
from tests.desk.cli.conftest import Command

SPEED = 0.5


def test_masses_decoded_from_the_bus_are_right_once_learned() -> None:
    scene = Demo(0.3, 4, seed=1)
    result = scene.run(SPEED)
    assert [row.number for row in result.masses] == [1, 2, 3, 4]
    assert [row.valid for row in result.masses] == [False, False, False, True]
    for row in result.masses:
        assert row.reference is not None
        assert row.nominal == pytest.approx(0.79 * row.reference, rel=0.03)
        if row.valid:
            assert row.estimated == pytest.approx(row.reference, rel=0.01)


def test_command_prints_the_table_and_writes_the_figure(command: Command, tmp_path: Path) -> None:
    figure = tmp_path / "demo.png"
    done = command.done("demo", "--injections", 4, "--speed", SPEED, "--figure", figure)
    rows = [line.split() for line in done.out.splitlines()[2:]]
    assert [row[0] for row in rows] == ["1", "2", "3", "4"]
    assert rows[-1][-1] == "yes"
    assert float(rows[-1][3]) == pytest.approx(-20.5, abs=1.0)  # nominal model, percent
    assert abs(float(rows[-1][6])) < 1.0  # observer
    assert max(map(len, done.out.splitlines())) <= 80
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert str(figure) in done.err
