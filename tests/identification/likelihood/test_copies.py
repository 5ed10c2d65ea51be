"""Copies of a recording among those that are given."""

import io
from pathlib import Path

from rich.console import Console

from observer_rt.identification.likelihood.reading import without_copies


def test_copies_are_left_out_and_named(tmp_path: Path) -> None:
    one, other, copy = (tmp_path / name for name in ("one.csv", "other.csv", "copy.csv"))
    one.write_text("1")
    other.write_text("2")
    copy.write_text("1")
    said = io.StringIO()
    assert without_copies([one, other, copy, one], Console(file=said, width=500)) == [one, other, one]
    assert said.getvalue() == f"warning: {copy} is left out: a copy of {one}\n"
