"""Logs of text, line by line, packed by gzip or not."""

import zlib
from collections.abc import Iterator
from gzip import BadGzipFile, GzipFile
from io import TextIOWrapper
from typing import BinaryIO, NoReturn, cast

from observer_rt.foundation.errors import UserError
from observer_rt.recording.canlog.can_log import LogReader
from observer_rt.recording.canlog.foreign import GZIP_MARK, likeness

_LINES_TO_KNOW = 20
_SIZE_AT_END = 4  # bytes of a gzip file that say how long its content is


class TextLogReader(LogReader):
    """Reader of a log of text, in UTF-8 or what is left of another encoding; whether it is packed, its bytes say."""

    def _lines(self) -> Iterator[tuple[int, str]]:
        """Every line with its number, from 1.

        A last one without its end is left out, and told: what is left of a frame may look like a shorter one.
        """
        with self.path.open("rb") as raw:
            is_packed = raw.read(len(GZIP_MARK)) == GZIP_MARK
            if is_packed:
                raw.seek(max(0, self._size - _SIZE_AT_END))
                self._size = int.from_bytes(raw.read(), "little")
            raw.seek(0)
            content = cast(BinaryIO, GzipFile(fileobj=raw)) if is_packed else raw
            with TextIOWrapper(content, encoding="utf-8-sig", errors="replace") as file:
                try:
                    for number, line in enumerate(file, start=1):
                        self._position += len(line)
                        if line.endswith("\n"):
                            yield number, line
                        elif line.strip():
                            self.remarks.append(f"line {number} is cut short and left out")
                except EOFError:
                    self.remarks.append(
                        "the end of the packed file is missing, and with it the end of the log"
                    )
                except (BadGzipFile, zlib.error) as error:
                    problem = f"is damaged, it cannot be unpacked: {error}"
                    raise UserError(str(self.path), problem, "give the complete file") from None

    def refuse_content(
        self, number: int, problem: str, remedy: str = "delete it, or record the log again"
    ) -> NoReturn:
        """As `refuse`, saying what the file looks like instead if nothing of it could be read so far."""
        looks, rename = likeness(self.path) if number <= _LINES_TO_KNOW else ("", "")
        self.refuse(number, f"{problem}{looks}", rename or remedy)
