"""Text logs, line by line; foreign lines are refused by name."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import ClassVar, NoReturn

from observer_rt.files.canlog.can_log import ZEROS, LogReader
from observer_rt.foundation.units import NANOSECONDS

_HEAD = 200  # bytes
_OTHER_KINDS = {  # what to do with a file, by how it begins; a suffix: it is a log that should have it
    b"date ": ".asc",
    b"base hex": ".asc",
    b";$FILEVERSION": ".trc",
    b";##########": ".trc",
    b"LOGG": ".blf",
    b"MDF ": ".mf4",
    b"UnFinMF": ".mf4",
    b"(": ".log",
    b"timestamp,arbitration_id": ".csv",
    b"\x1f\x8b": "unpack it by gunzip",
    b"***BUSMASTER": "a log of BUSMASTER: convert it to .asc by its format converter",
    b"Time Stamp,ID,": "a log of SavvyCAN: save it there as Candump/Kayak, .log",
    b"TimestampEpoch;": "a .csv of CSS Electronics: give the .mf4 of the logger, of which it was made",
    b"\x0a\x0d\x0d\x0a": "a capture: open it in SavvyCAN and save it as Candump/Kayak, .log",
    b"@ TEXT @": "a log of CarBus Analyzer: export it as .asc, .blf or .trc from the program that wrote it",
}
_LINES_TO_KNOW = 20
LONGEST_LINE = 1 << 16  # characters: what is no text may be one line of any length
EARLIEST_DATE = 100_000_000 * NANOSECONDS  # since 1970: what is less counts from the start of a log
_RUN = "\0" * 8  # fewer are no run of them
FROM_START = "its times are taken to count from its start"


def other_kind(path: Path) -> str:
    """What to do with a file that begins as of another kind, else empty. Raises `OSError` if it does not open."""
    with path.open("rb") as file:
        head = file.read(_HEAD).removeprefix(b"\xef\xbb\xbf").replace(b'"', b"")
    begins = (head, head.lstrip())
    remedies = (remedy for mark, remedy in _OTHER_KINDS.items() if any(begin.startswith(mark) for begin in begins))
    remedy = next(remedies, "")
    if not remedy.startswith("."):
        return remedy
    return "" if path.suffix.lower() == remedy else f"a log of another kind: name it so: {path.stem}{remedy}"


class TextLogReader(LogReader):
    """Reader of a log of text, in UTF-8, other bytes replaced."""

    kind: ClassVar[str]
    """Kind of its files, with an article."""

    def _lines(self) -> Iterator[tuple[int, str]]:
        """Lines, stripped and not blank, with their numbers from 1.

        A last one without its end is left out, and reported: a cut frame may look like a shorter one. So are zeros at
        the end, of a file whose size was set beforehand.
        """
        zeros = 0
        with self.path.open(encoding="utf-8-sig", errors="replace") as file:
            for number, line in enumerate(iter(partial(file.readline, LONGEST_LINE), ""), 1):
                self._position += len(line)
                text = line.strip()
                if text.endswith(_RUN):
                    zeros += len(text) - len(text := text.rstrip("\0"))
                elif text and (zeros or text.startswith(_RUN)):
                    self.refuse(number, "zeros stand before it, in place of frames")
                elif len(line) == LONGEST_LINE:
                    self.refuse_line(number, f"more than {LONGEST_LINE} characters")
                if text and (zeros or not line.endswith("\n")):
                    self.remarks.append(f"line {number} is cut short and left out")
                elif text:
                    yield number, text
        if zeros:
            self.remarks.append(ZEROS.format(zeros))

    def refuse_line(self, number: int, text: str) -> NoReturn:
        """Refuse a line that does not belong to such a log; the file may be of another kind."""
        shown = "".join(sign if sign.isprintable() else "?" for sign in text[:60])
        remedy = other_kind(self.path) if number <= _LINES_TO_KNOW else ""
        self.refuse(number, f"not a line of {self.kind}: '{shown}'", remedy or "delete it, or record the log again")

    def remark(self, text: str) -> None:
        """Note something of the whole log, once."""
        if text not in self.remarks:
            self.remarks.append(text)
