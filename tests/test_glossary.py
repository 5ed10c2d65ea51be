"""Places in the code that the glossary and the tour name are there."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "observer_rt"
PLACE = re.compile(r"`([\w./]+\.(?:py|pyx|pxd|pxi)|[\w]+(?:/[\w]+)+)`(?:: `(\w+)`)?")


@pytest.mark.parametrize("page", ["glossary.md", "tour.md"])
def test_places_are_there(page: str) -> None:
    entries = PLACE.findall((ROOT / "docs" / page).read_text())
    assert len(entries) > 20
    assert [path for path, _ in entries if not any(PACKAGE.rglob(path))] == []
    named = [(PACKAGE / path, name) for path, name in entries if name]
    assert [f"{path}: {name}" for path, name in named if not re.search(rf"\b{name}\b", path.read_text())] == []
