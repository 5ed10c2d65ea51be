"""docs/fit.md: its commands run as they stand; its keys are those there are."""

import re
from pathlib import Path

import pytest

from observer_rt.model.baseline import Baseline
from tests.cli.conftest import Command
from tests.cli.test_pages import run_all
from tests.pages import Page

PAGE = Page("docs/fit.md")


@pytest.mark.slow
def test_the_commands_run(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    commands = [line for line in PAGE.commands if "healthy_*" not in line]
    assert len(commands) == 4
    run_all(command, commands)
    assert Path("fitted.toml").exists()
    assert Path("fit.png").exists()


def test_the_keys_of_the_baseline_are_those_there_are() -> None:
    section = PAGE.text.split("## `[baseline]`\n")[1].split("\n## ")[0]
    keys = {
        key for row in re.findall(r"^\| (`.*?`) \|", section, re.M) for key in re.findall(r"`(\w+)`", row)
    }
    assert keys == set(Baseline.model_fields) - {"format"}
