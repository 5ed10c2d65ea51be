"""The page on databases: what it shows is what the commands print and what the files say."""

import re
from pathlib import Path

import pytest

from tests.cli.conftest import Command

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "dbc.md").read_text(encoding="utf-8")
DATABASES = ROOT / "tests" / "bus" / "databases"
EXAMPLES = ("testbed_classic", "fast_daq_fd", "adc_multiplexed")


def transcript(line: str) -> list[str]:
    """The lines shown after a command line."""
    _, _, after = PAGE.partition(f"    $ {line}\n")
    return re.match(r"(?:    .*\n)+", after).group(0).splitlines()  # type: ignore[union-attr]


def words(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.parametrize("name", EXAMPLES)
def test_what_check_prints(name: str, command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.chdir(DATABASES)
    outcome = command("check", "--bench", f"{name}.toml")
    printed = {words(line) for line in outcome.out.splitlines()}
    shown = transcript(f"observer-rt check --bench {name}.toml")
    assert len(shown) >= 5
    assert [
        line for line in shown if words(line) not in printed and words(line) not in _continued(printed)
    ] == []


def _continued(printed: set[str]) -> set[str]:
    """A line without its topic, which the page shows only where the topic begins."""
    return {line.partition(" ")[2] for line in printed}


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_files_say_what_the_page_quotes(name: str) -> None:
    bench = (DATABASES / f"{name}.toml").read_text()
    database = (DATABASES / f"{name}.dbc").read_text()
    section = PAGE[: PAGE.index(f"check --bench {name}.toml")].rsplit("\n### ", 1)[1]
    quoted = [line.strip() for line in section.splitlines() if line.startswith("    ") and "$" not in line]
    assert len(quoted) > 5
    for line in quoted:
        assert line in bench or line in database, line


def test_an_overlap(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = (DATABASES / "testbed_classic.dbc").read_text()
    mistaken = text.replace("RP_SensorState : 55|2@0+", "RP_SensorState : 47|2@0+")
    assert mistaken != text
    (tmp_path / "testbed_classic.dbc").write_text(mistaken)
    bench = (DATABASES / "testbed_classic.toml").read_text()
    (tmp_path / "testbed_classic.toml").write_text(bench)
    monkeypatch.chdir(tmp_path)
    outcome = command("run", "--bench", "testbed_classic.toml")
    assert outcome.code == 2
    shown = transcript("observer-rt run --bench testbed_classic.toml")
    assert [words(line) for line in shown] == [
        words(line) for line in outcome.err.splitlines() if line.strip()
    ]
    lenient = bench.replace('"testbed_classic.dbc"', '"testbed_classic.dbc"\nlenient = true', 1)
    (tmp_path / "testbed_classic.toml").write_text(lenient)
    monkeypatch.setenv("COLUMNS", "200")
    outcome = command("check", "--bench", "testbed_classic.toml")
    assert "overlooked: testbed_classic.dbc: The signals RP_SensorState and RP_RailPressure" in outcome.out
