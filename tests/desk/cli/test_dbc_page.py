"""The pages on databases and on buses: what they show is what the commands print and what the files say."""

from pathlib import Path

import pytest

from tests.desk.cli.conftest import Command
from tests.pages import ROOT, Page

PAGE = Page("docs/dbc.md")
DATABASES = ROOT / "tests" / "bus" / "databases"
EXAMPLES = [(PAGE, "testbed_classic"), (Page("docs/buses.md"), "three_buses")]


def words(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.parametrize(("page", "name"), EXAMPLES)
def test_what_check_prints(page: Page, name: str, command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.chdir(DATABASES)
    printed = words(command("check", "--bench", f"{name}.toml").out)  # a long finding takes several lines
    shown = [words(line) for line in page.shown(f"observer-rt check --bench {name}.toml")]
    assert len(shown) >= 5
    assert [line for line in shown if line not in printed] == []


@pytest.mark.parametrize(("page", "name"), EXAMPLES)
def test_the_files_say_what_the_page_quotes(page: Page, name: str) -> None:
    files = [DATABASES / f"{name}.toml", DATABASES / f"{name}.dbc"]
    text = "".join(path.read_text() for path in files if path.exists())
    before, _, after = page.text.partition(f"{name}.toml")
    section = before.rsplit("\n### ", 1)[-1] + after.split("\n#", 1)[0].split("    $ ", 1)[0]
    quoted = [line.strip() for line in section.splitlines() if line.startswith("    ")]
    assert len(quoted) > 5
    assert [line for line in quoted if line not in text] == []


def test_an_overlap(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (DATABASES / "testbed_classic.dbc").read_text()
    mistaken = text.replace("RP_SensorState : 55|2@0+", "RP_SensorState : 47|2@0+")
    assert mistaken != text
    (tmp_path / "testbed_classic.dbc").write_text(mistaken)
    bench = (DATABASES / "testbed_classic.toml").read_text()
    (tmp_path / "testbed_classic.toml").write_text(bench)
    monkeypatch.chdir(tmp_path)
    said = words(command.refused("run", "--bench", "testbed_classic.toml"))
    assert "error: testbed_classic.dbc:22: The signals RP_SensorState and RP_RailPressure are overlapping" in said
    assert "remedy: mend the bus database, or read it all the same: lenient = true in its [[dbc]]" in said
    monkeypatch.setenv("COLUMNS", "200")
    overlooked = "overlooked: testbed_classic.dbc: The signals RP_SensorState and RP_RailPressure"
    lenient = bench.replace('"testbed_classic.dbc"', '"testbed_classic.dbc"\nlenient = true', 1)
    (tmp_path / "testbed_classic.toml").write_text(lenient)
    assert overlooked in command("check", "--bench", "testbed_classic.toml").out
