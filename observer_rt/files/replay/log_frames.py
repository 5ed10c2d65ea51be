"""A CAN log, or a part of it, as the frames that are replayed: once or again."""

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import NamedTuple

from observer_rt.files.canlog.can_log import NANOSECONDS, LogReader
from observer_rt.files.formats import open_log
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.files.replay.recording_frames import Extent, refuse_unordered
from observer_rt.foundation.errors import UserError


class Sent(NamedTuple):
    """A kind of frames that is sent on a bus."""

    bus: int
    identifier: int
    is_extended: bool


def channel_map(texts: Sequence[str]) -> dict[str, str]:
    """Bus channels by channel of the log. Raises `UserError` for text that is not `FROM=TO`, or maps one twice."""
    channels: dict[str, str] = {}
    for text in texts:
        source, _, target = text.partition("=")
        if not source or not target:
            raise UserError(
                "--map-channel", f"'{text}' is not of the form FROM=TO", "write it like can0=vcan0"
            )
        if source in channels:
            raise UserError("--map-channel", f"'{source}' is mapped twice", "once is enough")
        channels[source] = target
    return channels


@dataclass(frozen=True)
class LogExtent(Extent):
    """Extent of a log, its routes from channels to buses, and its oddities."""

    identifiers: frozenset[Sent]
    channels: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class LogPart:
    """Selected frames of a log, on a time that begins at 0: [start, stop) in seconds after the log's first frame.

    The replay begins at `start`, or with the first frame. leave_out: frames not to send, such as results that were
    recorded beside the inputs. buses: only frames of these channels, onto these buses; None: all, onto the first.
    """

    path: Path
    start: float | None = None
    stop: float | None = None
    leave_out: Collection[Sent] = frozenset()
    buses: Mapping[str, int] | None = None

    def __iter__(self) -> Iterator[TimedFrame]:
        """Read the log once. Raises `UserError`, also while iterating: malformed, or nothing is selected."""
        return self._frames(open_log(self.path))

    def extent(self) -> LogExtent:
        """Read the log to its end: malformed entries are found before anything is sent; errors as by iterating."""
        log = open_log(self.path)
        duration, frames = 0.0, 0
        identifiers: set[Sent] = set()
        channels: dict[str, None] = {}
        for frame in self._frames(log):
            duration, frames = frame.time, frames + 1
            identifiers.add(Sent(frame.bus, frame.frame_id, frame.is_extended))
            channels[frame.channel] = None
        return LogExtent(duration, frames, frozenset(identifiers), tuple(channels), tuple(log.notes()))

    def _frames(self, log: LogReader) -> Iterator[TimedFrame]:
        refuse_unordered(self.start, self.stop)
        start = 0.0 if self.start is None else self.start
        stop = math.inf if self.stop is None else self.stop
        leave_out, channels = frozenset(self.leave_out), set[str]()
        first_stamp: int | None = None
        selected, moment = 0, 0.0
        for entry in log:
            frame = entry.frame
            if first_stamp is None:
                first_stamp = frame.stamp_ns
            channels.add(entry.channel)
            moment = (frame.stamp_ns - first_stamp) / NANOSECONDS
            bus = 0 if self.buses is None else self.buses.get(entry.channel)
            if (
                bus is not None
                and start <= moment < stop
                and (bus, frame.frame_id, frame.is_extended) not in leave_out
            ):
                selected += 1
                yield TimedFrame(
                    moment - start,
                    frame.frame_id,
                    frame.is_extended,
                    frame.is_fd,
                    frame.payload,
                    entry.channel,
                    frame.bit_rate_switch,
                    frame.error_state_indicator,
                    bus,
                )
        if not selected:
            self._refuse_empty(channels, moment, log.notes())

    def _refuse_empty(self, channels: set[str], until: float, notes: Sequence[str]) -> None:
        """Raise `UserError` for a log without a frame to send; until: time of its last frame [s]."""
        if not channels:
            said = f" ({'; '.join(notes)})" if notes else ""
            raise UserError(
                str(self.path), f"holds no data frame{said}", "record it while frames are on the bus"
            )
        missing = sorted(set(self.buses or ()) - channels)
        if missing:
            raise UserError(
                f"channel {', '.join(missing)}",
                f"is not in {self.path}, which has {', '.join(sorted(channels))}",
                "name a channel of the log",
            )
        if self.start is None and self.stop is None:
            raise UserError(
                str(self.path), "holds nothing but results of the observer", "record the inputs as well"
            )
        raise UserError(
            "--start, --stop",
            f"select no frame of {self.path}, which runs from 0 to {until:.6g} s",
            "choose times within the log",
        )


def log_frames(part: LogPart, loop: int = 1) -> Iterator[TimedFrame]:
    """Frames of a log as recorded; in a loop only the times go on. loop: how often, 0 for ever.

    Raises `UserError`: while iterating: nothing is selected, or the log is malformed or too short to be looped.
    """
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
