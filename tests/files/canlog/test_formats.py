"""Every log format: frames written are read back, by us and by python-can; damaged files never pass for whole."""

import gzip
from pathlib import Path

import can
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog import text_log
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.formats import LOGS_WRITTEN, is_log, open_log
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import NANOSECONDS
from tests.files.canlog.log_cases import FORMATS, START, as_read, log_frames, message_of, mixture, moved, write_log

SUFFIXES = sorted(FORMATS)
STARTS = (START, START, 1_000_000, 999_999_999, 631_152_000_000_000_000)  # about the least of formats
STREAMED = [suffix for suffix in SUFFIXES if suffix != ".mf4"]  # readable up to where they were cut


@pytest.mark.parametrize("suffix", LOGS_WRITTEN)
def test_whatever_is_written_is_read(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"bus{suffix}"

    @settings(max_examples=50)
    @given(st.sampled_from(STARTS).flatmap(lambda start: log_frames(suffix, start)))
    def check(frames: list[LogFrame]) -> None:
        stamps = {round(entry.frame.stamp_ns, -4) for entry in frames}
        # Whole seconds that several frames share are refused: their times are lost.
        assume(len(stamps) == len(frames) or any(stamp % NANOSECONDS for stamp in stamps))
        write_log(path, frames)
        log = open_log(path)
        assert moved(log, as_read(frames, suffix)) < 2000
        assert log.notes() == [] or not frames  # an empty one may be the rest of a damaged one

    check()


@pytest.mark.parametrize("suffix", LOGS_WRITTEN)
def test_python_can_reads_what_is_written(tmp_path: Path, suffix: str) -> None:
    path, frames = tmp_path / f"ours{suffix}", mixture(suffix, 200)
    write_log(path, frames)
    with can.LogReader(path) as reader:
        messages = list(reader)
    for message, frame in zip(messages, frames, strict=True):
        assert message.equals(message_of(frame), timestamp_delta=2e-6, check_channel=False)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_python_can_writes_is_read(tmp_path: Path, suffix: str) -> None:
    path, frames = tmp_path / f"theirs{suffix}", mixture(suffix, 200)
    with can.Logger(path) as logger:
        for frame in frames:
            logger(message_of(frame))
    entries = list(open_log(path))
    fields, expected = ([(*f.frame[:2], *f.frame[3:], f.is_sent) for f in log] for log in (entries, frames))
    assert fields == expected
    theirs, ours = (
        [(each.frame.stamp_ns - log[0].frame.stamp_ns) / 1e9 for each in log] for log in (entries, frames)
    )
    assert theirs == pytest.approx(ours, abs=2e-6)


@pytest.mark.parametrize("suffix", STREAMED)
def test_a_file_cut_anywhere_gives_the_frames_before_and_says_so(
    tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("can.BLFWriter.max_container_size", 1000)
    path, cut = tmp_path / f"bus{suffix}", tmp_path / f"cut{suffix}"
    write_log(path, mixture(suffix, 30))
    data = path.read_bytes()
    complete = list(open_log(path))
    for size in range(0, len(data), 3):
        cut.unlink(missing_ok=True)  # a file rewritten would wait for the disk on some file systems
        cut.write_bytes(data[:size])
        log = open_log(cut)
        try:
            entries = list(log)
        except UserError:
            assert size < 200  # within the heading
            continue
        assert entries == complete[: len(entries)]
        if 0 < len(entries) < len(complete) and not log.notes():
            assert suffix in (".log", ".trc")  # ended by its end of line, it may have had more lines
            assert data[len(data[:size].rstrip()) :].lstrip(b" ").startswith((b"\n", b"\r\n"))


@pytest.mark.parametrize("suffix", STREAMED)
def test_zeros_behind_the_last_frame_are_left_out(tmp_path: Path, suffix: str) -> None:
    """As of a file whose size was set beforehand; amid the frames they are damage."""
    path = write_log(tmp_path / f"bus{suffix}", mixture(suffix, 3))
    data, complete = path.read_bytes(), list(open_log(path))
    for zeros in (8, 200_000):
        path.write_bytes(data + bytes(zeros))
        log = open_log(path)
        assert list(log) == complete
        assert [note for note in log.notes() if f"its last {zeros} bytes are zeros, and left out" in note]
    path.write_bytes(data + bytes(200_000) + data)
    with pytest.raises(UserError, match=r"zeros stand before it|no object begins where one should"):
        list(open_log(path))


def test_a_line_cut_by_zeros_is_left_out(tmp_path: Path) -> None:
    path = write_log(tmp_path / "bus.log", mixture(".log", 3))
    path.write_bytes(path.read_bytes()[:-2] + bytes(8))
    log = open_log(path)
    assert len(list(log)) == 2
    assert "line 3 is cut short and left out" in log.notes()[0]


@pytest.mark.slow
def test_mdf4_cut_anywhere_is_refused(tmp_path: Path) -> None:
    path = write_log(tmp_path / "bus.mf4", mixture(".mf4", 30))
    data = path.read_bytes()
    for size in range(0, len(data), 211):
        path.write_bytes(data[:size])
        with pytest.raises(UserError):
            list(open_log(path))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_other_content_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"picture{suffix}"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 10)
    with pytest.raises(UserError):
        list(open_log(path))


@pytest.mark.parametrize("content", [suffix for suffix in SUFFIXES if suffix != ".mf4"])
@pytest.mark.parametrize("suffix", STREAMED)
def test_a_log_under_the_wrong_name_is_recognised(tmp_path: Path, suffix: str, content: str) -> None:
    if suffix == content:
        return
    written, path = tmp_path / f"bus{content}", tmp_path / f"named.2024-05-03{suffix}"
    write_log(written, mixture(content, 5))
    path.write_bytes(written.read_bytes())
    with pytest.raises(UserError, match=rf"name it so: named.2024-05-03\{content}"):
        list(open_log(path))


def test_a_log_of_another_program_is_named(tmp_path: Path) -> None:
    path = tmp_path / "bus.asc"
    for begin, remedy in (
        ("Time Stamp,ID,Extended,Dir,Bus,LEN,D1", "a log of SavvyCAN: save it there as Candump/Kayak"),
        ("***BUSMASTER Ver 3.2.2***", r"a log of BUSMASTER: convert it to \.asc"),
        ('"TimestampEpoch";"BusChannel"', r"a \.csv of CSS Electronics: give the \.mf4"),
        ("\n\r\r\n", "a capture: open it in SavvyCAN"),
        ("@ TEXT @ 2 @ 64 @ 0 @ 55 @", "a log of CarBus Analyzer: export it as"),
    ):
        path.write_bytes(f"{begin}\n1,123,false,Rx,0,1,00\n".encode() * 100)
        with pytest.raises(UserError, match=remedy):
            list(open_log(path))


@pytest.mark.parametrize("suffix", [".log", ".mf4"])
def test_time_that_steps_back_begins_a_part_and_a_swap_is_told(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"bus{suffix}"
    begin = START // 1000 * 1000
    stamps = [begin, begin + 5_000_000, begin + 4_500_000]
    frames = [LogFrame(Frame(1, b"\1", stamp, False, False), "1") for stamp in stamps]
    write_log(path, frames)
    log = open_log(path)
    assert len(list(log)) == 3
    assert suffix == ".mf4" or "1 frame stands 500 us before an earlier one" in log.notes()[0]
    write_log(path, [*frames, frames[0], frames[1]])
    log = open_log(path)
    result = [entry.frame.stamp_ns for entry in log]
    assert result[-2] - max(result[:3]) == pytest.approx(1_000_000_000, abs=1000)
    assert result[-1] - result[-2] == pytest.approx(5_000_000, abs=1000)
    assert sum("steps back by 0.00" in note and "split there" in note for note in log.notes()) == 1
    assert not any("ahead" in note for note in log.notes())
    write_log(path, [frames[0]._replace(frame=frames[0].frame._replace(stamp_ns=10**9)), *frames])  # 1 s after 1970
    list(log)
    assert sum("steps ahead by 1.7e+09 s" in note for note in log.notes()) == 1


def test_kinds_of_files() -> None:
    assert is_log(Path("a.BLF"))
    assert not is_log(Path("a.csv"))


@pytest.mark.parametrize("suffix", [".log", ".blf", ".mf4"])
def test_missing_file(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(UserError, match="no such file"):
        list(open_log(tmp_path / f"absent{suffix}"))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_how_much_was_read_is_known_while_reading(tmp_path: Path, suffix: str) -> None:
    log = open_log(write_log(tmp_path / f"bus{suffix}", mixture(suffix, 200)))
    shares = [log.share_read for _ in log]
    assert shares == sorted(shares)
    assert 0.0 < shares[0] <= shares[-1] <= 1.0
    assert shares[-1] > 0.9


def test_a_byte_order_mark(tmp_path: Path) -> None:
    path, frames = tmp_path / "bus.log", mixture(".log", 3)
    write_log(path, frames)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert moved(open_log(path), as_read(frames, ".log")) < 2000


@pytest.mark.parametrize("suffix", [".asc", ".csv"])
def test_a_packed_log_without_its_suffix_is_refused_with_its_remedy(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"bus{suffix}"
    path.write_bytes(gzip.compress(b"(1.5) can0 123#00\n") + b"\n")
    with pytest.raises(UserError, match="unpack it by gunzip"):
        list(open_log(path))


def test_bytes_that_are_no_text_are_not_shown(tmp_path: Path) -> None:
    path = tmp_path / "bus.log"
    path.write_bytes(b"\x00\x1b[31mred\x07\n")
    with pytest.raises(UserError, match=r"not a line of a candump log: '\?\?\[31mred\?'"):
        list(open_log(path))


def test_a_line_without_end_is_no_memory_without_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text_log, "LONGEST_LINE", 1000)
    path = tmp_path / "bus.log"
    path.write_bytes(b"(1.5) can0 123#00\n" + b"0" * 10_000_000 + b"\n")
    with pytest.raises(UserError, match=r"line 2: .*more than 1000 characters"):
        list(open_log(path))
