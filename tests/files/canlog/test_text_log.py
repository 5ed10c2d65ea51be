"""What all logs of text have in common: packed ones, and stamps that are whole seconds only."""

import gzip
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog import text_log
from observer_rt.files.canlog.asc import AscLog
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.canlog.text_log import TextLogReader
from observer_rt.files.canlog.trc import TrcLog
from observer_rt.files.formats import is_log, open_log
from observer_rt.foundation.errors import UserError
from tests.files.canlog.log_cases import FORMATS, START, as_read, mixture, write_log

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
    assert list(log) == frames
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
        assert found == frames[: len(found)]
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
    assert list(open_log(path)) == as_read(frames, suffix)


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


class SlowAscLog(AscLog):
    def _frames(self, text: str, lines: int) -> None:
        return None


class SlowTrcLog(TrcLog):
    def _frames(self, text: str, lines: int) -> None:
        return None


def everything(log: TextLogReader) -> list[object]:
    """Frames and notes, and the refusal if there is one."""
    found: list[object] = []
    try:
        found.extend(log)
    except UserError as error:
        found.append(str(error))
    return [*found, log.notes()]


@pytest.mark.parametrize(
    ("suffix", "fast", "slow"), [(".asc", AscLog, SlowAscLog), (".trc", TrcLog, SlowTrcLog)]
)
def test_lines_read_at_once_are_read_as_one_by_one(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    suffix: str,
    fast: type[TextLogReader],
    slow: type[TextLogReader],
) -> None:
    """Whatever is changed in them."""
    monkeypatch.setattr(text_log, "LINES_AT_ONCE", 3)
    path = tmp_path / f"bus{suffix}"
    classic = [entry for entry in mixture(suffix, 40) if not entry.frame.is_fd][:12]
    write_log(path, classic)
    whole = path.read_text()
    comment = (
        whole.replace("\n", "  Length = 230000 BitCount = 118 ID = 291x\n") if suffix == ".asc" else whole
    )
    signs = st.text(alphabet=" \n0123459ABFabfxRTd-.:_/;\t\u0663", max_size=3)

    @settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
    @given(
        text=st.sampled_from(
            (whole, comment, whole.replace("absolute", "relative"), whole.replace("hex", "dec"))
        ),
        place=st.integers(0, len(comment)),
        removed=st.integers(0, 3),
        added=signs,
    )
    def check(text: str, place: int, removed: int, added: str) -> None:
        path.write_text(text[:place] + added + text[place + removed :], encoding="utf-8")
        assert everything(fast(path)) == everything(slow(path))

    check()
    path.write_text(whole)
    assert list(fast(path)) == as_read(classic, suffix)


def test_a_packed_line_without_end_is_no_memory_without_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(text_log, "LONGEST_LINE", 1000)
    path = tmp_path / "bus.log.gz"
    path.write_bytes(gzip.compress(b"(1.5) can0 123#00\n" + b"0" * 10_000_000 + b"\n"))
    with pytest.raises(UserError, match="line 2: not a line of a candump log"):
        list(open_log(path))
