"""The page on discovery: its commands do what it says, and it knows every reservation there is."""

import re
from pathlib import Path

import pytest

import observer_rt.discovery.findings
from tests.cli.conftest import Command
from tests.pages import Page, words_of

PAGE = Page("docs/discovery.md")


@pytest.mark.slow
def test_the_commands_of_the_page(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    of_ones_own, simulate, discover, evaluate, compare = (words_of(line)[0] for line in PAGE.commands)
    assert of_ones_own[:2] == ["discover", "--out"]  # the same with other files, run by test_pages.py
    for words in (simulate, discover, evaluate):
        command.done(*words)
    assert {path.suffix for path in Path("found/data").iterdir()} == {".csv", ".svg"}
    Path("found").rename("found_later")
    command.done(*discover)
    done = command.done(*compare)
    assert "no change that shows" in done.out


def test_every_reservation_is_explained() -> None:
    source = Path(observer_rt.discovery.findings.__file__).read_text(encoding="utf-8")
    known = set(re.findall(r'Caveat\(\s*"(\w+)"', source))
    assert len(known) > 5
    assert set(re.findall(r"^\| `(\w+)` \|", PAGE.text, re.MULTILINE)) - {"id"} == known
