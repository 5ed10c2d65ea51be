"""`evaluate --twice`: what it prints, and what does not go with it."""

from pathlib import Path

import pytest

from tests.desk.cli.conftest import Command


@pytest.fixture
def worn(command: Command, tmp_path: Path) -> Path:
    path = tmp_path / "worn.csv"
    options = ("--rail-pressure", "60,100,140", "--injections", 4, "--effect", "orifice_area=0.3")
    command.done("simulate", "--output", path, *options)
    return path


def test_all_are_valid_the_second_time(command: Command, worn: Path, tmp_path: Path) -> None:
    once = command.done("evaluate", worn).out
    assert "not valid for TOO_FEW_EVENTS: 1-2" in once
    assert "--twice" in once
    picture = tmp_path / "worn.png"
    assert "not valid" not in command.done("evaluate", worn, "--twice", "--plot", picture).out
    assert picture.exists()


def test_what_does_not_go_with_it_is_refused(command: Command, worn: Path, tmp_path: Path) -> None:
    assert "--output" in command.refused("evaluate", worn, "--twice", "--output", tmp_path / "trace.csv")
    assert "--no-learning" in command.refused("evaluate", worn, "--twice", "--no-learning")
