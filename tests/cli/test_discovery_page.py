"""The page on discovery: its commands do what it says, and it knows every reservation there is."""

import re
import shlex
from pathlib import Path

import pytest

import observer_rt.discovery.caveats
from tests.cli.conftest import Command

PAGE = (Path(__file__).parents[2] / "docs" / "discovery.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_commands_of_the_page(command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    lines = re.findall(r"^    \$ observer-rt (.*)$", PAGE, re.MULTILINE)
    assert len(lines) == 4
    for line in lines[:-1]:
        assert command(*shlex.split(line)).code == 0
    assert {path.suffix for path in Path("found/data").iterdir()} == {".csv", ".svg"}
    Path("found").rename("found_later")
    assert command(*shlex.split(lines[1])).code == 0
    done = command(*shlex.split(lines[-1]))
    assert done.code == 0
    assert "no change that shows" in done.out


def test_every_reservation_is_explained() -> None:
    source = Path(observer_rt.discovery.caveats.__file__).read_text(encoding="utf-8")
    known = set(re.findall(r'Caveat\(\s*"(\w+)"', source))
    assert len(known) > 5
    assert set(re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE)) - {"id"} == known
