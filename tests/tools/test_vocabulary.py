"""The lint of names and phrases that say little."""

import subprocess
import sys
from pathlib import Path

import pytest

LINT = Path(__file__).parents[2] / "tools/lib/vocabulary.py"


@pytest.mark.parametrize(
    ("source", "word"),
    [
        ("found = 1", "found"),
        ("def read(place: int) -> None: ...", "place"),
        ("class InputsWatched: ...", "InputsWatched"),
        ('"""Says what is there."""', "what is"),
        ("[one for one in ()]", ""),
        ("class Speed: ...", ""),
        ("print(found)", ""),
    ],
)
def test_a_name_or_phrase_that_says_little_is_listed(source: str, word: str, tmp_path: Path) -> None:
    path = tmp_path / "module.py"
    path.write_text(source)
    done = subprocess.run([sys.executable, LINT, path], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == (f"{path}:1: {word}" if word else "")
