"""What all logs of text have in common, and stamps that are whole seconds only."""

import gzip
from pathlib import Path

import pytest

from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog import text_log
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.formats import is_log, open_log
from observer_rt.foundation.errors import UserError
from tests.files.canlog.log_cases import FORMATS, START, as_read, mixture, moved, write_log

TEXTS = (".log", ".asc", ".trc")


@pytest.mark.parametrize("suffix", TEXTS)
def test_a_byte_order_mark(tmp_path: Path, suffix: str) -> None:
    path, frames = tmp_path / f"bus{suffix}", mixture(suffix, 3)
    write_log(path, frames)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert moved(open_log(path), as_read(frames, suffix)) < 2000


@pytest.mark.parametrize("suffix", [*TEXTS, ".csv"])
def test_a_packed_log_is_refused_with_its_remedy(tmp_path: Path, suffix: str) -> None:
    named, hidden = tmp_path / f"bus{suffix}.gz", tmp_path / f"bus{suffix}"
    for path in (named, hidden):
        path.write_bytes(gzip.compress(b"(1.5) can0 123#00\n") + b"\n")
    with pytest.raises(UserError, match=rf"unknown kind of file '\.gz'(?s:.*)gunzip bus{suffix}\.gz"):
        is_log(named)
    with pytest.raises(UserError, match=r"a file packed by gzip(?s:.*)unpack it by gunzip"):
        list(open_log(hidden))


def test_bytes_that_are_no_text_are_not_shown(tmp_path: Path) -> None:
    path = tmp_path / "bus.log"
    path.write_bytes(b"\x00\x1b[31mred\x07\n")
    with pytest.raises(UserError, match=r"not a line of a candump log: '\?\?\[31mred\?'"):
        list(open_log(path))


@pytest.mark.parametrize("suffix", sorted(FORMATS))
def test_stamps_of_whole_seconds_only_are_refused_in_every_format(tmp_path: Path, suffix: str) -> None:
    """So that none is written from which another is refused."""
    path = tmp_path / f"bus{suffix}"
    second = START // 10**9 * 10**9
    write_log(path, [LogFrame(Frame(1, b"", second, False, False), "1")] * 3)
    with pytest.raises(UserError, match="all stamps are whole seconds"):
        list(open_log(path))


def test_a_line_without_end_is_no_memory_without_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text_log, "LONGEST_LINE", 1000)
    path = tmp_path / "bus.log"
    path.write_bytes(b"(1.5) can0 123#00\n" + b"0" * 10_000_000 + b"\n")
    with pytest.raises(UserError, match="line 2: it has more than 1000 characters"):
        list(open_log(path))
