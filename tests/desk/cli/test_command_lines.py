"""Mistakes in arguments are named with remedies, before any work; lines and answers: mistakes.txt (… for lists)."""

import re
from pathlib import Path

import pytest

from tests.desk.cli.conftest import Command

SAID = Path(__file__).with_name("mistakes.txt").read_text(encoding="utf-8")
MISTAKES = dict(part.split("\n", 1) for part in re.split(r"^\$ ", SAID, flags=re.MULTILINE)[1:])


def contents(folder: Path) -> dict[Path, bytes | None]:
    return {path: path.read_bytes() if path.is_file() else None for path in folder.iterdir()}


@pytest.mark.parametrize("line", MISTAKES)
def test_a_mistake_is_named_before_any_work(
    command: Command,
    worn: Path,
    resting: Path,
    bench: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    line: str,
) -> None:
    """`worn.csv`, `resting.csv`: recordings, `a.log`: of one frame, `folder.csv`: a folder; all else is not there."""
    for recording in (worn, resting):
        (tmp_path / recording.name).write_bytes(recording.read_bytes())
    (tmp_path / "a.log").write_text("(100.000000) can0 123#AA\n")
    (tmp_path / "folder.csv").mkdir()
    before = contents(tmp_path)
    monkeypatch.chdir(tmp_path)
    outcome = command(*line.split())
    assert (outcome.code, outcome.out) == (2, "")
    said = re.escape(MISTAKES[line]).replace("…", ".*")
    assert re.fullmatch(said, outcome.err), outcome.err
    assert contents(tmp_path) == before
