"""The lint of names and phrases that say little."""

import subprocess
import sys
from pathlib import Path

import pytest

LINT = Path(__file__).parents[2] / "tools/lib/vocabulary.py"


@pytest.mark.parametrize(
    ("source", "places"),
    [
        ("found = 1", "1: found"),
        ("def read(place: int) -> None: ...", "1: place"),
        ("class InputsWatched: ...", "1: InputsWatched"),
        ('"""Says what is there."""', "1: what is"),
        ("[one for one in ()]", ""),
        ("class Speed: ...", ""),
        ("print(found)", ""),
        ("cdef double each(int64_t* row, double place=other) noexcept:", "1: each 1: place"),
        ("cdef int64_t k = found + rest, told = 0  # of it", "1: told"),
        ("cdef struct Row:\n    double[3] rest\n    double x", "2: rest"),
        (
            "cdef f():\n    for there in x:\n        whole = '#'\n    if it == 1:\n        return found",
            "2: there 3: whole",
        ),
        ('cdef f():\n    """Tells what is there."""', "2: what is"),
    ],
)
def test_a_name_or_phrase_that_says_little_is_listed(source: str, places: str, tmp_path: Path) -> None:
    path = tmp_path / ("module.pxi" if source.startswith("cdef") else "module.py")
    path.write_text(source)
    done = subprocess.run([sys.executable, LINT, path], capture_output=True, text=True, check=True)
    assert " ".join(done.stdout.replace(f"{path}:", "").split("\n")).strip() == places
