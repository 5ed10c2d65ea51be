"""Logs and recordings damaged anywhere: what they held, or an error that names the file; never less in silence."""

import random
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from observer_rt.files.formats import SIGNALS_WRITTEN, open_log, open_recording, write_recording
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.errors import UserError
from tests.files.canlog.log_cases import FORMATS, mixture, write_log
from tests.files.signals.foreign import bench

FRAMES = 12
COMMENTS = {".log": b"#", ".asc": b"/;", ".trc": b";"}  # what begins with one is none by the rules of the format

Damage = Callable[[bytes], bytes]


@cache
def undamaged(suffix: str, folder: Path) -> bytes:
    return write_log(folder / f"whole{suffix}", mixture(suffix, FRAMES)).read_bytes()


@st.composite
def damages(draw: st.DrawFn) -> Damage:
    """A stretch of bytes replaced by others; the seed chooses where, whatever the length of the file."""
    chance = random.Random(draw(st.integers(0, 2**32)))
    removed = draw(st.sampled_from((0, 1, 1, 2, 5)))
    added = draw(st.binary(max_size=6) | st.sampled_from((b"\n", b" ", b"0", b"9", b"x", b"\0", b"\xff", b"R")))

    def damage(data: bytes) -> bytes:
        position = chance.randrange(len(data))
        return data[:position] + added + data[position + removed :]

    return damage


T = TypeVar("T")


def unless_refused(path: Path, read: Callable[[], T]) -> T | None:
    try:
        return read()
    except UserError as error:
        refusal = str(error)
    assert str(path) in refusal
    return None


def often(suffix: str) -> settings:
    examples = settings().max_examples
    return settings(max_examples=min(examples, 20) if suffix == ".mf4" else examples)


@pytest.mark.parametrize("suffix", sorted(FORMATS))
def test_a_damaged_log(tmp_path: Path, suffix: str) -> None:
    complete = undamaged(suffix, tmp_path)

    @often(suffix)
    @given(damages())
    def check(damage: Damage) -> None:
        data = damage(complete)
        path = tmp_path / f"damaged{suffix}"
        path.write_bytes(data)
        log = open_log(path)
        entries = unless_refused(path, lambda: list(log))
        if (
            entries  # every command refuses a log without frames
            and len(entries) < FRAMES
            and not _comments(suffix, data) - _comments(suffix, complete)
        ):
            assert log.notes() != []

    check()


def _comments(suffix: str, data: bytes) -> set[bytes]:
    """Damage may make a comment of a frame: nobody can tell."""
    marks = COMMENTS.get(suffix, b"")
    return {line for line in data.splitlines() if line.strip()[:1] in marks and line.strip()}


@pytest.mark.parametrize("layout", [*sorted(SIGNALS_WRITTEN), "foreign"])
def test_a_damaged_recording(tmp_path: Path, layout: str) -> None:
    is_own = layout in SIGNALS_WRITTEN
    path = tmp_path / f"recording{layout if is_own else '.csv'}"
    values = np.arange(20.0)
    write_recording(path, Recording(values / 1e5, values * 1e5, values * 1e-6, values * 1e5))
    if not is_own:
        heading = "t;p_Rail;lift;p_Line\nms;bar;um;MPa\n"
        path.write_text(heading + "".join(f"{n / 100};{n};{n};{n / 10}\n" for n in range(20)))
    injector = None if is_own else bench(tmp_path).injector
    complete = path.read_bytes()

    @often(path.suffix)
    @given(damages())
    def check(damage: Damage) -> None:
        path.write_bytes(damage(complete))
        recording = unless_refused(path, lambda: open_recording(path, injector).collected())
        assert recording is None or recording.samples == values.size or recording.notes or not is_own

    check()
