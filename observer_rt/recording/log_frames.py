"""A candump log, or a part of it, as the frames that are replayed: as recorded, once or again and again."""

import math
from collections.abc import Collection, Iterator
from itertools import count
from pathlib import Path

from observer_rt.errors import UserError
from observer_rt.recording.candump_log import NANOSECONDS, CandumpLog
from observer_rt.recording.framing import TimedFrame
from observer_rt.recording.recording_frames import Extent, refuse_unordered


def log_frames(
    path: Path,
    loop: int = 1,
    start: float | None = None,
    stop: float | None = None,
    leave_out: Collection[tuple[int, bool]] = frozenset(),
) -> Iterator[TimedFrame]:
    """Frames of a candump log as recorded, of all its channels; in a loop only the times go on.

    loop: how often, 0 for ever. start, stop: [start, stop) in seconds after the log's first frame; the replay
    begins at `start`, or with the first frame. leave_out: (identifier, is extended) of frames not to send, such
    as results that were recorded beside the inputs.

    Raises:
        UserError: nothing is selected; while iterating: the log is malformed, or too short to be looped.
    """
    part = _Part(path, start, stop, leave_out)
    if next(iter(part), None) is None:
        raise UserError(
            "--start, --stop",
            f"select no frame of {path}, which runs from 0 to {part.last_seen:.6g} s",
            "choose times within the log",
        )
    return _looped(part, loop)


def log_extent(
    path: Path,
    start: float | None = None,
    stop: float | None = None,
    leave_out: Collection[tuple[int, bool]] = frozenset(),
) -> Extent:
    """Extent of one loop of `log_frames`, which raises the same errors.

    Reads the log to its end: what is malformed is found before anything is sent.
    """
    duration, frames = 0.0, 0
    for frame in log_frames(path, 1, start, stop, leave_out):
        duration, frames = frame.time, frames + 1
    return Extent(duration, frames)


class _Part:
    """Selected frames of a log, on a time that begins at 0."""

    def __init__(
        self, path: Path, start: float | None, stop: float | None, leave_out: Collection[tuple[int, bool]]
    ) -> None:
        refuse_unordered(start, stop)
        self.path = path
        self.last_seen = 0.0
        """Time of the last frame read, selected or not, in seconds after the log's first."""
        self._start = 0.0 if start is None else start
        self._stop = math.inf if stop is None else stop
        self._leave_out = frozenset(leave_out)

    def __iter__(self) -> Iterator[TimedFrame]:
        first_stamp: int | None = None
        for entry in CandumpLog(self.path):
            frame = entry.frame
            if first_stamp is None:
                first_stamp = frame.stamp_ns
            self.last_seen = (frame.stamp_ns - first_stamp) / NANOSECONDS
            if (
                self._start <= self.last_seen < self._stop
                and (frame.frame_id, frame.is_extended) not in self._leave_out
            ):
                moment = self.last_seen - self._start
                yield TimedFrame(moment, frame.frame_id, frame.is_extended, frame.is_fd, frame.payload)


def _looped(part: _Part, loop: int) -> Iterator[TimedFrame]:
    offset = 0.0
    for number in count(1):
        first = last = math.nan
        frames = 0
        for frame in part:
            first = frame.time if frames == 0 else first
            last = frame.time
            frames += 1
            yield frame._replace(time=offset + frame.time)
        if number == loop:
            return
        if not last > first:
            raise UserError(
                str(part.path), "has no duration after which it could begin again", "use --loop 1"
            )
        offset += last + (last - first) / (frames - 1)  # the next loop follows after an average interval
