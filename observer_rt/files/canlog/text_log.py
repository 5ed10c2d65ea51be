"""Logs of text, line by line, packed or not: foreign content and times from start or line to line are recognised."""

import gzip
import zlib
from abc import abstractmethod
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from gzip import BadGzipFile, GzipFile
from io import TextIOWrapper
from itertools import islice
from pathlib import Path
from typing import BinaryIO, ClassVar, NoReturn, cast

from observer_rt.files.canlog.can_log import NANOSECONDS, LogFrame, LogReader
from observer_rt.foundation.console import PACKED
from observer_rt.foundation.errors import UserError

GZIP_MARK = b"\x1f\x8b"
_HEAD = 200  # bytes
_CAPTURE = b"\x0a\x0d\x0d\x0a"
_READ = (  # how a file begins, whose it is, the suffix it is read by
    (b"date ", "a log of Vector's tools", ".asc"),
    (b"base hex", "a log of Vector's tools", ".asc"),
    (b";$FILEVERSION", "a log of PEAK's tools", ".trc"),
    (b";##########", "a log of PEAK's tools", ".trc"),
    (b"***BUSMASTER", "a log of BUSMASTER", ".log"),
    (b"LOGG", "Vector's binary log", ".blf"),
    (b"MDF ", "an MDF file", ".mf4"),
    (b"UnFinMF", "an MDF file", ".mf4"),
    (b"(", "a log of candump", ".log"),
    (_CAPTURE, "a capture", ".pcapng"),
    (b"Time Stamp,ID,", "a log of SavvyCAN", ".csv"),
    (b"timestamp,arbitration_id", "python-can's .csv", ".csv"),
    (b"TimestampEpoch;", "a log of CSS Electronics", ".csv"),
)
_UNREAD = (
    (b"@ TEXT @", "a log of CarBus Analyzer"),
    (b"//---------------------------------\nMicrochip", "a log of Microchip's CAN analyzer"),
    (b"//---------------------------------\r\nMicrochip", "a log of Microchip's CAN analyzer"),
    (b"SQLite format 3", "a database, as python-can's .db"),
    (b"CAN Record", "a log of Kvaser's tools"),
    (b"Kvaser", "a log of Kvaser's tools"),
    (b"\xff\xfe", "text in UTF-16"),
    (b"PK\x03\x04", "a zip archive"),
)

_LINES_TO_KNOW = 20
LINES_AT_ONCE = 60
LONGEST_LINE = 1 << 16  # characters, of what is packed: zeros would be one line of any length
EARLIEST_DATE = 100_000_000 * NANOSECONDS  # since 1970: what is less counts from the start of a log
_SIZE_AT_END = 4  # bytes of a gzip file that hold the length of its content

SURE_OF_START = 30  # times that are the largest so far
SURE_OF_LINES = 8  # times that differ from the one before


def head_of(path: Path) -> bytes:
    """Beginning of a file, that of a packed one unpacked. Raises `OSError` for a file that cannot be opened."""
    with path.open("rb") as file:
        head = file.read(_HEAD)
        if head.startswith(GZIP_MARK):
            file.seek(0)
            with suppress(OSError, EOFError, zlib.error):
                head = gzip.GzipFile(fileobj=file).read(_HEAD)
    return head.removeprefix(b"\xef\xbb\xbf")


def likeness(path: Path) -> tuple[str, str]:
    """Likely kind of a file and its remedy, for the ends of problem and remedy; empty if unknown."""
    head, named = head_of(path), path.name.lower().removesuffix(PACKED)
    head = head if head.startswith(_CAPTURE) else head.lstrip()
    for mark, name, suffix in _READ:
        if head.startswith(mark) and not named.endswith(suffix):
            return f"; it looks like {name}", f"name it so: {path.stem}{suffix}"
    for mark, name in _UNREAD:
        if head.startswith(mark):
            return f"; it looks like {name}", "export it as .asc, .blf or .trc from the program that wrote it"
    return "", ""


class TextLogReader(LogReader):
    """Reader of a log of text, in UTF-8 or what is left of another encoding; packed or not, by its first bytes."""

    kind: ClassVar[str]
    """Kind of its files, with an article."""
    remedy: ClassVar[str] = ""
    """Remedy for a line that is none of such a log, if not the usual one."""

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        for first, lines in self._blocks():
            frames = self._frames("".join(lines), len(lines))
            if frames is not None:
                yield from enumerate(frames, first)
                continue
            for number, line in enumerate(lines, first):
                if text := line.strip():
                    try:
                        entry = self._entry(text, number)
                    except (ValueError, IndexError):
                        shown = "".join(sign if sign.isprintable() else "?" for sign in text[:60])
                        self.refuse_content(number, f"not a line of {self.kind}: '{shown}'", self.remedy)
                    if entry is not None:
                        yield number, entry

    @abstractmethod
    def _entry(self, text: str, number: int) -> LogFrame | None:
        """The frame of a line that is not blank, if it has one. Raises `ValueError`, `IndexError` where malformed."""

    def _frames(self, text: str, lines: int) -> Iterator[LogFrame] | None:
        """The frames of so many lines, one each, as `_entry` has them; None unless all are of the usual form."""
        return None

    def _blocks(self) -> Iterator[tuple[int, list[str]]]:
        """Blocks of all lines, some at once, with the number of the first, counted from 1.

        A last one without its end is left out, and reported: what is left of a frame may look like a shorter one.
        """
        with self.path.open("rb") as raw:
            is_packed = raw.read(len(GZIP_MARK)) == GZIP_MARK
            if is_packed:
                raw.seek(max(0, self._size - _SIZE_AT_END))
                self._size = int.from_bytes(raw.read(), "little")
            raw.seek(0)
            content = cast(BinaryIO, GzipFile(fileobj=raw)) if is_packed else raw
            with TextIOWrapper(content, encoding="utf-8-sig", errors="replace") as file:
                following: Iterator[str] = file
                if is_packed:
                    following = iter(partial(file.readline, LONGEST_LINE), "")
                number, is_whole = 1, True
                while is_whole:
                    lines: list[str] = []
                    try:
                        lines.extend(islice(following, LINES_AT_ONCE))  # those before an error stay
                    except EOFError:
                        missing = "the end of the packed file is missing, and with it the end of the log"
                        self.remarks.append(missing)
                    except (BadGzipFile, zlib.error) as error:
                        problem = f"is damaged, it cannot be unpacked: {error}"
                        raise UserError(str(self.path), problem, "give the complete file") from None
                    self._position += sum(map(len, lines))
                    is_whole = len(lines) == LINES_AT_ONCE  # else the file has ended
                    if lines and not lines[-1].endswith("\n") and lines.pop().strip():
                        self.remarks.append(f"line {number + len(lines)} is cut short and left out")
                    if lines:
                        yield number, lines
                    number += len(lines)

    def refuse_content(self, number: int, problem: str, remedy: str = "") -> NoReturn:
        """Call `refuse`, with the likely kind of the file if nothing of it could be read so far."""
        looks, rename = likeness(self.path) if number <= _LINES_TO_KNOW else ("", "")
        self.refuse(number, f"{problem}{looks}", rename or remedy)


class Rising:
    """Counts times that are the largest so far: of those from a start most are, though frames are swapped."""

    def __init__(self) -> None:
        self._before = 0
        self._largest = 0
        self._rises = 0
        self._changes = 0

    def add(self, time: int) -> None:
        """Take the time of the next line, in any unit."""
        self._changes += time != self._before
        self._before = time
        if time > self._largest:
            self._largest = time
            self._rises += 1

    @property
    def is_from_start(self) -> bool:
        """Whether they surely count from a start."""
        return self._rises >= SURE_OF_START and 2 * self._rises > self._changes

    @property
    def is_from_line_to_line(self) -> bool:
        """Whether they surely are distances."""
        return self._changes >= SURE_OF_LINES and 2 * self._rises < self._changes
