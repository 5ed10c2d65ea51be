"""A CAN log as the frames that are replayed."""

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from observer_rt.files.canlog.can_log import NANOSECONDS, LogReader
from observer_rt.files.formats import open_log
from observer_rt.files.replay.framing import TimedFrame
from observer_rt.foundation.errors import UserError


class Sent(NamedTuple):
    """A kind of frames that is sent on a bus."""

    bus: int
    identifier: int
    is_extended: bool


class LogFrames:
    """Frames of a log as recorded, on a time that begins at 0 with its first frame; read anew by every iteration.

    The log is read to its end beforehand: malformed entries are found before anything is sent. duration: until the
    last frame [s]; sent: kinds of the frames; channels: those that they come from; notes: oddities of the log.
    """

    def __init__(
        self, path: Path, channels: Mapping[int, str | None], results: Collection[Sent] = frozenset()
    ) -> None:
        """channels: of the log by bus, None: all of them. results: of the observer, recorded beside its inputs.

        Results are not sent again. Raises `UserError` for a malformed log, or where nothing is left to send.
        """
        self.path = path
        self._channels, self._results = channels, frozenset(results)
        self.duration = 0.0
        sent: set[Sent] = set()
        present: dict[str, None] = {}
        log = open_log(path)
        for channel, frame in self._selected(log):
            self.duration = frame.time
            sent.add(Sent(frame.bus, frame.frame_id, frame.is_extended))
            present[channel] = None
        self.sent, self.channels, self.notes = frozenset(sent), tuple(present), tuple(log.notes())
        if not sent:
            wanted = ", ".join(each for each in channels.values() if each is not None)
            what = f"frame of channel {wanted}" if wanted else "frame but results of the observer"
            raise UserError(
                str(path), "; ".join([f"holds no data {what}", *self.notes]), "record the inputs on that channel"
            )

    def __iter__(self) -> Iterator[TimedFrame]:
        return (frame for _, frame in self._selected(open_log(self.path)))

    def _selected(self, log: LogReader) -> Iterator[tuple[str, TimedFrame]]:
        first_stamp: int | None = None
        for entry in log:
            frame = entry.frame
            if first_stamp is None:
                first_stamp = frame.stamp_ns
            for bus, channel in self._channels.items():
                if channel in (None, entry.channel) and (bus, frame.frame_id, frame.is_extended) not in self._results:
                    yield (
                        entry.channel,
                        TimedFrame(
                            (frame.stamp_ns - first_stamp) / NANOSECONDS,
                            frame.frame_id,
                            frame.is_extended,
                            frame.is_fd,
                            frame.payload,
                            frame.bit_rate_switch,
                            frame.error_state_indicator,
                            bus,
                        ),
                    )
