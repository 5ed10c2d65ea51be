"""Recorder of buses into log files: every frame, whichever comes first, and how many were lost on the way."""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from observer_rt.bus.links.link import LONGEST_WAIT, BusFrame, Frame, Link, LinkDownError
from observer_rt.bus.links.opening import reconnect
from observer_rt.files.canlog.can_log import LogFrame, LogWriter
from observer_rt.files.formats import LOGS_WRITTEN, open_writer
from observer_rt.foundation.errors import UserError, file_errors
from observer_rt.foundation.files import begin_stream
from observer_rt.foundation.outputs import check_output
from observer_rt.foundation.units import NANOSECONDS

FLUSH_PERIOD = 1_000_000_000  # ns: no more than this is lost with the power
REPORT_PERIOD = 250_000_000  # ns
LATEST_FRAME = 10_000_000_000  # ns by which a frame of another bus may be older than the first that came
RECEIVE_TIMEOUT = 0.1  # s, after which the loop looks at its clock and its stop signal
CAPACITY = 20_000  # frames that reading threads keep; what comes on top of them waits in the drivers
_FULL_WAIT = 1e-3  # s


class EnduringReading:
    """Receives from several links, a thread each, in the order read; reconnects a link that went down."""

    def __init__(self, links: Sequence[Link]) -> None:
        self._links = links
        self._outages = [0] * len(links)
        self._dropped = [link.dropped for link in links]
        self._arrived: SimpleQueue[tuple[BusFrame, int] | Exception] = SimpleQueue()
        self._ended = threading.Event()
        self._threads = [
            threading.Thread(target=self._read, args=(bus,), name=f"reading bus {bus}", daemon=True)
            for bus in range(len(links))
        ]
        for thread in self._threads:
            thread.start()

    @property
    def outages(self) -> int:
        return sum(self._outages)

    @property
    def dropped(self) -> int:
        """Frames that all links together lost before those that were taken."""
        return sum(self._dropped)

    def receive(self, timeout_s: float) -> BusFrame | None:
        """The next frame of any bus, None if none came in time; also after `close`. Raises what made a link fail."""
        try:
            arrived = self._arrived.get(timeout=timeout_s)
        except Empty:
            self._dropped = [link.dropped for link in self._links]
            return None
        if isinstance(arrived, Exception):
            raise arrived
        frame, dropped = arrived
        self._dropped[frame.bus] = dropped
        return frame

    def close(self) -> None:
        """End the threads; the links stay open."""
        self._ended.set()
        for thread in self._threads:
            thread.join()

    def _read(self, bus: int) -> None:
        link = self._links[bus]
        try:
            while not self._ended.is_set():
                if self._arrived.qsize() > CAPACITY:
                    time.sleep(_FULL_WAIT)
                    continue
                try:
                    frame = link.receive(LONGEST_WAIT)
                except LinkDownError:
                    self._outages[bus] += 1
                    reconnect(link, self._ended)
                else:
                    if frame is not None:
                        self._arrived.put((BusFrame(bus, frame), link.dropped))
        except Exception as error:  # whatever it is, who receives must get it
            self._arrived.put(error)


@dataclass
class RecordStatistics:
    """What was recorded so far: frames, frames lost before, time [s], files; what an outage lost nobody counts."""

    frames: int = 0
    lost: int = 0
    outages: int = 0
    duration: float = 0.0
    files: list[Path] = field(default_factory=list)

    def as_text(self) -> str:
        rate = self.frames / self.duration if self.duration else 0.0
        names = ", ".join(str(path) for path in self.files) or "no file, for no frame came in"
        away = f", interface away {self.outages} times" if self.outages else ""
        return f"{self.frames} frames in {self.duration:.1f} s ({rate:.0f} a second), {self.lost} lost{away}; {names}"

    def as_json(self) -> dict[str, Any]:
        return {
            "frames": self.frames,
            "lost_frames": self.lost,
            "outages": self.outages,
            "duration_s": self.duration,
            "files": [str(path) for path in self.files],
        }


def check_recording_path(path: Path, force: bool) -> None:
    """Raise `UserError` for a format that is not safe while recording, and for a log that is there without force."""
    if path.suffix.lower() not in LOGS_WRITTEN:
        problem = f"'{path.suffix}' cannot be recorded into safely"
        raise UserError(f"--out {path}", problem, f"record into {' or '.join(LOGS_WRITTEN)}, then convert")
    check_output("--out", path, force)


def record(
    links: Mapping[str, Link],
    path: Path,
    stop: threading.Event,
    report: Callable[[RecordStatistics], None] = lambda _: None,
    force: bool = False,
    duration: float | None = None,
    frames: int | None = None,
) -> RecordStatistics:
    """Write every frame of the links until `stop` is set or a limit reached; a file begins with its first frame.

    `links`: by their names in the log; `force`: replace a log; duration [s], frames: limits. An interface that goes
    away is waited for. `report` is called some times a second. Raises `RunError`: the link failed for good, or the
    disk is full; what was written before can be read.
    """
    channels = list(links)
    log = _Log(path, force)
    receiver = EnduringReading(list(links.values()))
    statistics = RecordStatistics(files=log.paths)
    start = time.monotonic_ns()
    next_flush, next_report = start + FLUSH_PERIOD, start
    lost_before = receiver.dropped
    with file_errors(path):
        try:
            while True:
                if is_stopped := stop.is_set():
                    receiver.close()
                received = receiver.receive(0.0 if is_stopped else RECEIVE_TIMEOUT)
                if is_stopped and received is None:  # all that was read is written
                    break
                now = time.monotonic_ns()
                statistics.outages = receiver.outages
                statistics.duration = (now - start) / NANOSECONDS
                lost = receiver.dropped - lost_before
                if lost > statistics.lost:
                    log.lost += lost - statistics.lost
                    statistics.lost = lost
                if received is not None:
                    log.write(received.frame, channels[received.bus])
                    statistics.frames += 1
                if now >= next_flush:
                    log.flush()
                    next_flush = now + FLUSH_PERIOD
                if now >= next_report:
                    report(statistics)
                    next_report = now + REPORT_PERIOD
                if (duration is not None and statistics.duration >= duration) or (
                    frames is not None and statistics.frames >= frames
                ):
                    break
        finally:
            receiver.close()
            log.close()
    return statistics


class _Log:
    def __init__(self, path: Path, force: bool) -> None:
        self.paths: list[Path] = []
        """The file, once it is begun."""
        self._path, self._force = path, force
        self._writer: LogWriter | None = None
        self.lost = 0
        """Number of lost frames that are noted before the next one."""

    def write(self, frame: Frame, channel: str) -> None:
        if self._writer is None:
            begin_stream(self._path, self._force)
            self._writer = open_writer(self._path, frame.stamp_ns - LATEST_FRAME)
            self.paths.append(self._path)
        self._note_lost(self._writer)
        self._writer.write(LogFrame(frame, channel))

    def flush(self) -> None:
        if self._writer is not None:
            self._writer.flush()

    def close(self) -> None:
        if self._writer is not None:
            self._note_lost(self._writer)
            self._writer.close()
            self._writer = None

    def _note_lost(self, writer: LogWriter) -> None:
        if self.lost:
            writer.write_lost(self.lost)
            self.lost = 0
