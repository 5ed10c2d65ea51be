"""CAN logs, whatever their format: frames they hold, what they leave out, how formats are described and written."""

import re
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from itertools import islice
from pathlib import Path
from typing import ClassVar, NamedTuple, NoReturn

from observer_rt.bus.can_frame import CLASSIC_LENGTH, EXTENDED_MASK, FD_LENGTHS, STANDARD_MASK
from observer_rt.bus.links.link import Frame
from observer_rt.foundation.errors import UserError, file_errors
from observer_rt.foundation.units import NANOSECONDS, NANOSECONDS_PER_MS

REORDERED = NANOSECONDS_PER_MS  # by which drivers are seen to hand over frames in the wrong order
PAUSE = NANOSECONDS  # between two parts of a log whose clock was set back
YEAR = 365 * 86_400 * NANOSECONDS  # no pause within a log is so long
FRAMES_TO_JUDGE_STAMPS = 100
LATEST_STAMP = (1 << 63) - 1  # ns since 1970, in 2262
ZEROS = "its last {} bytes are zeros, and left out"  # as of a file whose size was set beforehand
_LENGTHS = {True: frozenset(FD_LENGTHS), False: frozenset(range(CLASSIC_LENGTH + 1))}  # by whether FD
_LOST = re.compile(r"(\d+) frames lost before this")


class LogFrame(NamedTuple):
    """A data frame of a log, with what a `Frame` does not carry."""

    frame: Frame
    channel: str
    """Channel as the log names it: `can0` in text of candump, `1` where channels are numbered."""
    is_sent: bool = False
    """Sent by the computer that recorded it."""


def lost_note(frames: int) -> str:
    """Note that a recorder writes into a log where frames were lost."""
    return f"{frames} frames lost before this"


class LogReader(ABC):
    """Data frames of one log, read while iterating, in the order of the file; the counters belong to one reading.

    Iterating raises `UserError` that names file and place for a malformed entry, an impossible frame, and stamps of
    whole seconds. A frame cut at the end is left out. Where time steps back on a channel a new part begins, `PAUSE`
    later; `notes` reports that, and steps ahead by more than a `YEAR`.

    remote_frames, error_frames, other_entries: left out; lost_frames: by the log's own record.
    """

    unit: ClassVar[str] = "line"
    """Unit that places in the file are counted in."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._reset()

    def _reset(self) -> None:
        self.remote_frames = self.error_frames = self.other_entries = self.lost_frames = 0
        self.remarks: list[str] = []
        self._steps_back: list[str] = []
        self._reordered = self._most_reordered = self._size = self._position = 0

    @property
    def share_read(self) -> float:
        """Share of the file that was read, 0 to 1."""
        return min(1.0, self._position / self._size) if self._size else 0.0

    def __iter__(self) -> Iterator[LogFrame]:
        self._reset()
        with file_errors(self.path):
            self._size = self.path.stat().st_size
            frames = self._checked(self._entries())
            first = list(islice(frames, FRAMES_TO_JUDGE_STAMPS))
            stamps = {entry.frame.stamp_ns for entry in first}
            if len(stamps) < len(first) and all(stamp % NANOSECONDS == 0 for stamp in stamps):
                problem = "all stamps are whole seconds, several frames share one: the times of the frames are lost"
                remedy = "record the log again, with finer stamps (candump -l writes microseconds)"
                raise UserError(str(self.path), problem, remedy)
            yield from first
            yield from frames

    @abstractmethod
    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        """Frames with their place in the file; whether a bus can carry them is checked afterwards."""

    def notes(self) -> list[str]:
        """Notes on what the last reading left out or found odd, one sentence each."""
        counts = {
            "error frames": self.error_frames,
            "remote frames": self.remote_frames,
            "entries that are no frames": self.other_entries,
        }
        counted = [f"{count} {kind}" for kind, count in counts.items() if count]
        notes = [f"left out: {', '.join(counted)}"] if counted else []
        if self.lost_frames:
            notes.append(f"{self.lost_frames} frames were lost while it was recorded")
        if self._reordered:
            count = "1 frame stands" if self._reordered == 1 else f"{self._reordered} frames stand up to"
            notes.append(f"{count} {self._most_reordered / 1000:g} us before an earlier one")
        if self._steps_back:
            times = f"{self._steps_back[0]} (in all {len(self._steps_back)} times)"
            notes.append(f"{times}: split there, the next part follows after 1 s")
        return [f"{self.path}: {note}" for note in (*notes, *self.remarks)]

    def refuse(self, number: int, problem: str, remedy: str = "record it again") -> NoReturn:
        """Raise `UserError` for a place in the file."""
        raise UserError(f"{self.path}, {self.unit} {number}", problem, remedy)

    def note_text(self, text: str) -> None:
        """Take a comment of the log: it may report lost frames."""
        lost = _LOST.search(text)
        self.lost_frames += int(lost[1]) if lost else 0

    def _checked(self, entries: Iterable[tuple[int, LogFrame]]) -> Iterator[LogFrame]:
        """The frames, each refused at its place unless a bus can carry it; time goes on in all of them."""
        latest: dict[str, int] = {}
        shift = 0  # ns by which the part that is read was moved
        lengths, largest = _LENGTHS, (STANDARD_MASK, EXTENDED_MASK)
        for number, entry in entries:
            frame, channel, _ = entry
            identifier, payload, stamp, is_extended, is_fd, _, _ = frame
            if len(payload) not in lengths[is_fd]:
                kind = "CAN FD" if is_fd else "classic CAN"
                self.refuse(number, f"{len(payload)} bytes are no length of a {kind} frame")
            if identifier > largest[is_extended]:
                kind = "extended" if is_extended else "standard"
                self.refuse(number, f"{identifier:X} is no {kind} identifier")
            if not 0 <= stamp <= LATEST_STAMP - shift:
                self.refuse(number, "its time is before 1970, or after 2262")
            stamp += shift
            back = latest.get(channel, stamp) - stamp
            if back > REORDERED:
                self._steps_back.append(f"{self.unit} {number}: time on {channel} steps back by {back / 1e9:.9g} s")
                step = max(latest.values()) + PAUSE - stamp
                shift, stamp = shift + step, stamp + step
            elif back > 0:
                self._reordered, self._most_reordered = self._reordered + 1, max(self._most_reordered, back)
            elif back < -YEAR:
                self.remarks.append(f"{self.unit} {number}: time on {channel} steps ahead by {-back / 1e9:.9g} s")
            latest[channel] = max(stamp, latest.get(channel, 0))
            yield entry._replace(frame=frame._replace(stamp_ns=stamp)) if shift else entry


class LogWriter(AbstractContextManager["LogWriter"]):
    """A log being written; a context manager completes it; flushed parts stay readable. Raises `OSError`."""

    def __init__(self, path: Path, start_ns: int) -> None:
        """start_ns: no frame is older; a format that counts time from a start begins there, or shortly before."""
        self.path = path
        self._start = start_ns
        self._numbers = ChannelNumbers()

    @abstractmethod
    def write(self, entry: LogFrame) -> None:
        """Append a frame. Raises `UserError` for one that the format cannot hold."""

    @abstractmethod
    def write_lost(self, frames: int) -> None:
        """Note in the log that frames were lost before the next one."""

    @abstractmethod
    def flush(self) -> None:
        """Hand everything written so far to the disk."""

    @abstractmethod
    def close(self) -> None:
        """Complete the file."""

    def __exit__(self, *_: object) -> None:
        self.close()


class ChannelNumbers:
    """Numbers for channel names: `can0` is 1 where counted from 1, unless another channel has that number."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}

    def of(self, channel: str) -> int:
        """The number, from 1, always the same for a channel."""
        if channel not in self._numbers:
            digits = re.search(r"\d*$", channel)
            last = int(digits[0]) if digits and digits[0] else 0
            number = max(1, last if channel.isdigit() else last + 1)
            while number in self._numbers.values():
                number += 1
            self._numbers[channel] = number
        return self._numbers[channel]


def text_nanoseconds(text: str) -> int:
    """Decimal text of seconds as whole ns: nothing is lost to binary fractions. Raises ValueError for other text."""
    seconds, _, fraction = text.replace(",", ".").partition(".")
    size = int(seconds.lstrip("-")) * NANOSECONDS + int(fraction[:9].ljust(9, "0"))
    return -size if seconds.startswith("-") else size


class LogFormat(NamedTuple):
    """Kind of file that holds CAN frames, by its suffix, in lower case with its dot.

    writer: by path and start [ns], None: only read; stamp_step [ns]; recognises: a log by its content, None: any is.
    """

    suffix: str
    reader: Callable[[Path], LogReader]
    writer: Callable[[Path, int], LogWriter] | None = None
    stamp_step: int = 1
    recognises: Callable[[Path], bool] | None = None
