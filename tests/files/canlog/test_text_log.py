"""What all logs of text have in common: packed ones, and stamps that are whole seconds only."""

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


def packed(folder: Path, suffix: str) -> tuple[Path, list[LogFrame]]:
    """A packed log, and what it holds."""
    frames = mixture(suffix, 300)
    plain = folder / f"bus{suffix}"
    write_log(plain, frames)
    path = folder / f"bus{suffix}.gz"
    path.write_bytes(gzip.compress(plain.read_bytes()))
    return path, as_read(frames, suffix)


@pytest.mark.parametrize("suffix", TEXTS)
def test_a_packed_log_is_read(tmp_path: Path, suffix: str) -> None:
    path, frames = packed(tmp_path, suffix)
    assert is_log(path)
    log = open_log(path)
    shares = [log.share_read for _ in log]
    assert moved(log, frames) < 2000
    assert log.notes() == []
    assert 0.0 < shares[0] < 0.5 < shares[-1] <= 1.0


@pytest.mark.parametrize("suffix", TEXTS)
def test_a_packed_log_that_was_cut_says_so(tmp_path: Path, suffix: str) -> None:
    path, frames = packed(tmp_path, suffix)
    data = path.read_bytes()
    for size in (len(data) // 2, len(data) - 1):
        path.write_bytes(data[:size])
        log = open_log(path)
        found = list(log)
        assert moved(found, frames[: len(found)]) < 2000
        assert sum("the end of the packed file is missing" in note for note in log.notes()) == 1


@pytest.mark.parametrize("suffix", TEXTS)
def test_a_packed_log_that_is_damaged_is_refused(tmp_path: Path, suffix: str) -> None:
    path, _ = packed(tmp_path, suffix)
    data = bytearray(path.read_bytes())
    data[-6] ^= 1  # of its check sum
    path.write_bytes(data)
    with pytest.raises(UserError, match="is damaged, it cannot be unpacked"):
        list(open_log(path))


@pytest.mark.parametrize("suffix", TEXTS)
def test_a_byte_order_mark(tmp_path: Path, suffix: str) -> None:
    path, frames = tmp_path / f"bus{suffix}", mixture(suffix, 3)
    write_log(path, frames)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert moved(open_log(path), as_read(frames, suffix)) < 2000


def test_other_packed_files_are_unknown(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"unknown kind of file '\.gz'"):
        is_log(tmp_path / "bus.gz")
    with pytest.raises(UserError, match=r"unknown kind of file '\.parquet\.gz'"):
        is_log(tmp_path / "bus.parquet.gz")


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


def test_a_packed_line_without_end_is_no_memory_without_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(text_log, "LONGEST_LINE", 1000)
    path = tmp_path / "bus.log.gz"
    path.write_bytes(gzip.compress(b"(1.5) can0 123#00\n" + b"0" * 10_000_000 + b"\n"))
    with pytest.raises(UserError, match="line 2: it has more than 1000 characters"):
        list(open_log(path))
