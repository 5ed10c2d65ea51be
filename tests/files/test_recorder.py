"""Recording a link: limits, lost frames, and files that can be read whatever happened."""

import errno
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

import pytest

from observer_rt.bus.links.link import BusFrame, Frame, LinkDownError
from observer_rt.files.formats import LOGS_WRITTEN, open_log
from observer_rt.files.recorder import EnduringReading, RecordStatistics, check_recording_path, record
from observer_rt.foundation.errors import RunError, UserError
from tests.files.canlog.log_cases import START
from tests.links import FakeLink

SUFFIXES = sorted(LOGS_WRITTEN)
PATIENCE = 20.0  # s


class Source(FakeLink):
    """Gives frames at once, then stops the recording; loses some where `lost_at` says so."""

    def __init__(self, count: int, lost_at: dict[int, int] | None = None) -> None:
        super().__init__()
        self.delivered, self.stop = 0, threading.Event()
        self._count, self._lost_at = count, lost_at or {}
        self.lost = 4  # before the recording began
        self.step_ns = 1000
        self.during: Callable[[], None] = lambda: None

    def receive(self, timeout_s: float) -> Frame | None:
        self.during()
        if self.delivered >= self._count:
            self.stop.set()
            return None
        self.lost += self._lost_at.get(self.delivered, 0)
        self.delivered += 1
        is_fd = self.delivered % 2 == 0
        return Frame(
            0x100 + self.delivered % 7,
            bytes(8),
            START + self.delivered * self.step_ns,
            False,
            is_fd,
            is_fd and self.delivered % 3 == 0,
            is_fd and self.delivered % 5 == 0,
        )

    def on_sent(self, frame: Frame) -> None:
        raise AssertionError("a recorder sends nothing")


def run(path: Path, source: Source, **limits: Any) -> RecordStatistics:
    return record({"can0": source}, path, source.stop, **limits)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_frame_is_in_the_file_and_where_some_were_lost(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"bus{suffix}"
    statistics = run(path, Source(300, {150: 3, 220: 9}))
    log = open_log(path)
    entries = [(entry.frame, log.lost_frames) for entry in log]
    assert [lost for _, lost in entries] == [0] * 150 + [3] * 70 + [12] * 80
    stamps = [START + n * 1000 for n in range(1, 301)]
    assert [frame.stamp_ns for frame, _ in entries] == pytest.approx(stamps, abs=999)
    assert [frame[4:] for frame, _ in entries] == [  # whether FD, its switch, its sender's state
        (n % 2 == 0, n % 6 == 0, n % 10 == 0) for n in range(1, 301)
    ]
    assert (statistics.frames, statistics.lost, statistics.files) == (300, 12, [path])
    assert "12 lost" in statistics.as_text()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_frame_may_be_older_than_the_first(tmp_path: Path, suffix: str) -> None:
    """Another bus's may have waited longer to be read."""
    path, source = tmp_path / f"bus{suffix}", Source(5)
    source.step_ns = -200_000
    run(path, source)
    stamps = [START + n * source.step_ns for n in range(5, 0, -1)]
    assert sorted(entry.frame.stamp_ns for entry in open_log(path)) == pytest.approx(stamps, abs=999)


def test_limits_end_it(tmp_path: Path) -> None:
    source = Source(10**9)
    by_count = run(tmp_path / "a.log", source, frames=123)
    assert by_count.frames == len(list(open_log(tmp_path / "a.log"))) == 123
    begun = time.monotonic()
    run(tmp_path / "b.log", source, duration=0.2)
    assert time.monotonic() - begun < 5.0
    assert not source.stop.is_set()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_after_a_second_frames_are_on_the_disk(tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Read beside the recorder, as after a loss of power: nothing was closed."""
    monkeypatch.setattr("observer_rt.files.recorder.FLUSH_PERIOD", 0)
    path, source, seen = tmp_path / f"bus{suffix}", Source(40), []

    def look() -> None:
        end = time.monotonic() + 20.0
        while source.delivered in (20, 39) and time.monotonic() < end:
            log = open_log(path)
            frames = len(list(log)) if path.exists() else 0
            if frames == source.delivered and log.notes() == []:
                seen.append(frames)
                return
            time.sleep(0.01)

    source.during = look
    run(path, source)
    assert seen == [20, 39]


@pytest.mark.parametrize("failure", [RunError("can0 is down"), OSError(errno.ENOSPC, "No space left")])
def test_a_failure_leaves_what_was_recorded(tmp_path: Path, failure: Exception) -> None:
    path, source = tmp_path / "bus.blf", Source(100)

    def fail() -> None:
        if source.delivered == 50:
            raise failure

    source.during = fail
    with pytest.raises(RunError):
        run(path, source)
    assert len(list(open_log(path))) == 50


def test_an_interface_that_goes_away_is_waited_for(tmp_path: Path) -> None:
    path = tmp_path / "bus.blf"

    class UnpluggedSource(Source):
        away = 0

        def receive(self, timeout_s: float) -> Frame | None:
            if self.delivered == 50 and not self.away:
                self.away = 3
            if self.away:
                raise LinkDownError("can0 is down")
            return super().receive(timeout_s)

        def reconnect(self) -> None:
            self.away -= 1
            if self.away:
                raise LinkDownError("can0 is still down")
            self.delivered = 51

    statistics = run(path, UnpluggedSource(100))
    assert (statistics.frames, statistics.outages) == (99, 1)
    assert "interface away 1 times" in statistics.as_text()
    stamps = [entry.frame.stamp_ns for entry in open_log(path)]
    assert stamps == pytest.approx([START + n * 1000 for n in range(1, 101) if n != 51], abs=999)


def test_without_a_frame_there_is_no_file(tmp_path: Path) -> None:
    statistics = run(tmp_path / "bus.blf", Source(0))
    assert not list(tmp_path.iterdir())
    assert "no file, for no frame came in" in statistics.as_text()


def test_paths_that_are_refused(tmp_path: Path) -> None:
    for suffix in (".mf4", ".asc", ".trc", ".csv", ".db"):
        with pytest.raises(UserError, match="cannot be recorded into safely"):
            check_recording_path(tmp_path / f"bus{suffix}", force=True)
    path = tmp_path / "bus.log"
    check_recording_path(path, force=False)
    path.touch()
    with pytest.raises(UserError, match="exists already"):
        check_recording_path(path, force=False)


def test_a_log_that_came_meanwhile_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "bus.log").write_text("mine")
    with pytest.raises(RunError, match=r"bus\.log: File exists"):
        run(tmp_path / "bus.log", Source(20))
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("bus.log", "mine")]


class PutLink(FakeLink):
    """Frames and failures put in by the test; it cannot be connected anew as often as stated."""

    def __init__(self) -> None:
        super().__init__()
        self.waiting: SimpleQueue[Frame | RunError] = SimpleQueue()
        self.away_for = 0

    def put(self, number: int) -> None:
        self.waiting.put(Frame(number, b"", 0))

    def receive(self, timeout_s: float) -> Frame | None:
        try:
            item = self.waiting.get(timeout=timeout_s)
        except Empty:
            return None
        if isinstance(item, RunError):
            raise item
        return item

    def reconnect(self) -> None:
        self.away_for -= 1
        if self.away_for >= 0:
            raise LinkDownError("still away")


@contextmanager
def links_and_reading(count: int) -> Iterator[tuple[list[PutLink], EnduringReading]]:
    links = [PutLink() for _ in range(count)]
    reader = EnduringReading(links)
    try:
        yield links, reader
    finally:
        reader.close()


def received(reader: EnduringReading, count: int) -> list[BusFrame]:
    frames = [reader.receive(PATIENCE) for _ in range(count)]
    return [frame for frame in frames if frame is not None]


def test_frames_of_all_buses_come_with_their_bus() -> None:
    with links_and_reading(3) as (links, reader):
        for number in range(30):
            links[number % 3].put(number)
        frames = received(reader, 30)
        assert reader.receive(0.01) is None
    for bus in range(3):
        assert [f.frame.frame_id for f in frames if f.bus == bus] == list(range(bus, 30, 3))


def test_a_bus_that_goes_down_comes_back_and_the_others_go_on() -> None:
    with links_and_reading(2) as (links, reader):
        links[1].away_for = 2
        links[1].waiting.put(LinkDownError("unplugged"))
        links[0].put(5)
        assert received(reader, 1)[0].bus == 0
        links[1].put(7)
        assert (received(reader, 1), reader.outages) == ([BusFrame(1, Frame(7, b"", 0))], 1)
        assert links[1].away_for == -1


def test_a_failure_for_good_is_raised() -> None:
    with links_and_reading(2) as (links, reader):
        links[1].waiting.put(RunError("broken"))
        with pytest.raises(RunError, match="broken"):
            received(reader, 1)


def test_it_ends_while_a_link_is_away() -> None:
    threads = threading.active_count()
    with links_and_reading(1) as (links, reader):
        links[0].away_for = 1 << 30
        links[0].waiting.put(LinkDownError("unplugged"))
        assert reader.receive(0.05) is None
    assert links[0].away_for < 1 << 30 or reader.outages <= 1
    assert threading.active_count() == threads
