"""The page on several buses: what it shows is what `check` prints and what the bench file says."""

import pytest

from tests.cli.conftest import Command
from tests.pages import ROOT, Page

PAGE = Page("docs/buses.md")
DATABASES = ROOT / "tests" / "bus" / "databases"
COMMAND = "observer-rt check --bench three_buses.toml"


def words(text: str) -> str:
    return " ".join(text.split())


def test_what_check_prints(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.chdir(DATABASES)
    printed = [words(line) for line in command("check", "--bench", "three_buses.toml").out.splitlines()]
    continued = [line.partition(" ")[2] for line in printed]
    lines = [words(line) for line in PAGE.shown(COMMAND)]
    assert len(lines) >= 10
    assert [line for line in lines if line not in printed and line not in continued] == []


def test_the_bench_file_says_what_the_page_quotes() -> None:
    bench = (DATABASES / "three_buses.toml").read_text()
    before = PAGE.text.partition(f"    $ {COMMAND}\n")[0]
    quoted = [line.strip() for line in before.splitlines() if line.startswith("    ")]
    assert len(quoted) > 15
    assert [line for line in quoted if line not in bench] == []
