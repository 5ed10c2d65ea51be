"""Places in the code that the glossary and the tour name are there."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "observer_rt"
PLACE = re.compile(r"`([\w./]+\.(?:py|pyx|pxd|pxi)|[\w]+(?:/[\w]+)+)`(?:: `(\w+)`)?")


def places(page: str) -> Iterator[tuple[str, str]]:
    """Path below the package, or a file's name alone, and the name that is to be in it, if any."""
    for match in PLACE.finditer((ROOT / "docs" / page).read_text()):
        yield match[1], match[2] or ""


@pytest.mark.parametrize("page", ["glossary.md", "tour.md"])
def test_places_are_there(page: str) -> None:
    entries = list(places(page))
    assert len(entries) > 20
    assert [path for path, _ in entries if not any(PACKAGE.rglob(path))] == []
    named = [(PACKAGE / path, name) for path, name in entries if name]
    assert [f"{path}: {name}" for path, name in named if not re.search(rf"\b{name}\b", path.read_text())] == []
