"""The registry of formats: the page and the help agree with it."""

import re
from pathlib import Path

from observer_rt.files.canlog.can_log import LogFormat
from observer_rt.files.formats import BUILT_IN
from tests.desk.cli.conftest import Command

PAGE = Path(__file__).parents[3] / "docs" / "recordings.md"


def test_the_page_lists_the_formats_of_the_registry() -> None:
    row = re.compile(r"^\| (`\.[^|]+`) \| ([^|]+) \|(?: (yes|no) \|)?$", re.MULTILINE)
    suffixes = {
        (suffix, match[2], match[3] == "yes")
        for match in row.finditer(PAGE.read_text(encoding="utf-8"))
        for suffix in re.findall(r"`(\.[\w.]+)`", match[1])
    }
    assert suffixes == {
        (suffix, each.description, isinstance(each, LogFormat) and each.recorder is not None)
        for each in BUILT_IN
        for suffix in each.suffixes
    }


def test_the_help_lists_the_formats_of_the_registry(command: Command) -> None:
    text = " ".join(command("convert", "--help").out.split())
    recordings, logs = ".csv, .mf4, .parquet, .txt", ".log, .blf, .asc, .trc, .mf4, .csv"
    assert f"Recording ({recordings}) or CAN log ({logs})." in text
    assert "no CAN FD in .trc" in text
    assert "Log to write (.log, .blf)" in " ".join(command("record", "--help").out.split())
