"""Text logs, line by line; foreign lines are refused by name."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import ClassVar, NoReturn

from observer_rt.files.canlog.can_log import NANOSECONDS, LogReader

_HEAD = 200  # bytes
_KNOWN = (  # how a file begins, whose it is, what to do; {0} stands for its name without suffix
    (b"date ", "a log of Vector's tools", "name it so: {0}.asc"),
    (b"base hex", "a log of Vector's tools", "name it so: {0}.asc"),
    (b";$FILEVERSION", "a log of PEAK's tools", "name it so: {0}.trc"),
    (b";##########", "a log of PEAK's tools", "name it so: {0}.trc"),
    (b"LOGG", "Vector's binary log", "name it so: {0}.blf"),
    (b"MDF ", "an MDF file", "name it so: {0}.mf4"),
    (b"UnFinMF", "an MDF file", "name it so: {0}.mf4"),
    (b"\x1f\x8b", "a file packed by gzip", "unpack it by gunzip"),
    (b"(", "a log of candump", "name it so: {0}.log"),
    (b"timestamp,arbitration_id", "python-can's .csv", "name it so: {0}.csv"),
    (
        b"***BUSMASTER",
        "a log of BUSMASTER",
        "convert it to {0}.asc by BUSMASTER's format converter (LOG to ASC)",
    ),
    (b"Time Stamp,ID,", "a log of SavvyCAN", "in SavvyCAN, save it as Candump/Kayak: {0}.log"),
    (b"TimestampEpoch;", "a .csv of CSS Electronics", "give the .mf4 of the logger, of which it was made"),
    (b"\x0a\x0d\x0d\x0a", "a capture", "open it in SavvyCAN and save it as Candump/Kayak: {0}.log"),
    (
        b"@ TEXT @",
        "a log of CarBus Analyzer",
        "export it as .asc, .blf or .trc from the program that wrote it",
    ),
)
_LINES_TO_KNOW = 20
LONGEST_LINE = 1 << 16  # characters: what is no text may be one line of any length
EARLIEST_DATE = 100_000_000 * NANOSECONDS  # since 1970: what is less counts from the start of a log
SURE_OF_START = 30  # times that are the largest so far
SURE_OF_LINES = 8  # times that differ from the one before


def head_of(path: Path) -> bytes:
    """Beginning of a file. Raises `OSError` for a file that cannot be opened."""
    with path.open("rb") as file:
        return file.read(_HEAD).removeprefix(b"\xef\xbb\xbf")


def likeness(path: Path) -> tuple[str, str]:
    """Likely kind of a file and its remedy, for the ends of problem and remedy; empty if unknown."""
    head, stem = head_of(path).replace(b'"', b""), path.name.split(".")[0]
    for mark, name, remedy in _KNOWN:
        todo = remedy.format(stem)
        if head.startswith(mark) or head.lstrip().startswith(mark):
            return (
                ("", "")
                if path.name.startswith(todo.removeprefix("name it so: "))
                else (f"; it looks like {name}", todo)
            )
    return "", ""


class TextLogReader(LogReader):
    """Reader of a log of text, in UTF-8, other bytes replaced."""

    kind: ClassVar[str]
    """Kind of its files, with an article."""
    remedy: ClassVar[str] = ""
    """Remedy for a line that is none of such a log, if not the usual one."""

    def _lines(self) -> Iterator[tuple[int, str]]:
        """Lines that are not blank, stripped, with their numbers, counted from 1.

        A last one without its end is left out, and reported: a cut frame may look like a shorter one.
        """
        with self.path.open(encoding="utf-8-sig", errors="replace") as file:
            for number, line in enumerate(iter(partial(file.readline, LONGEST_LINE), ""), 1):
                self._position += len(line)
                text = line.strip()
                if len(line) == LONGEST_LINE:
                    self.refuse_content(number, f"it has more than {LONGEST_LINE} characters")
                if text and not line.endswith("\n"):
                    self.remarks.append(f"line {number} is cut short and left out")
                elif text:
                    yield number, text

    def refuse_line(self, number: int, text: str) -> NoReturn:
        """Refuse a line that does not belong to such a log."""
        shown = "".join(sign if sign.isprintable() else "?" for sign in text[:60])
        self.refuse_content(number, f"not a line of {self.kind}: '{shown}'", self.remedy)

    def refuse_content(self, number: int, problem: str, remedy: str = "") -> NoReturn:
        """Call `refuse`, with the likely kind of the file if nothing of it could be read so far."""
        looks, rename = likeness(self.path) if number <= _LINES_TO_KNOW else ("", "")
        self.refuse(number, f"{problem}{looks}", rename or remedy)


class Rising:
    """Counts times that are the largest so far: of those from a start most are, though frames are swapped."""

    def __init__(self) -> None:
        self._before = self._largest = self._rises = self._changes = 0

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
