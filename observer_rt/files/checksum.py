"""A checksum of a whole file, as text within it: damage anywhere in what we write as MF4 or Parquet is found.

Neither format has one. The text stands where other programs keep comments, and show them.
"""

import re
import zlib
from pathlib import Path
from typing import BinaryIO

from observer_rt.foundation.errors import UserError

_TEXT = "observer-rt crc32 {:08x} of {:015d} bytes"
BLANK = _TEXT.format(0, 0)
"""Text that a file is to have within its last `_END` bytes, for `seal`."""
_STATED = re.compile(rb"observer-rt crc32 ([0-9a-f]{8}) of (\d{15}) bytes")
_END = 1 << 20  # bytes
_AT_ONCE = 1 << 20


def seal(path: Path) -> None:
    """Put the checksum of a file that is complete in place of its `BLANK`."""
    with path.open("r+b") as file:
        size, place, _ = _found(file)
        text = _TEXT.format(_checksum(file, place, size), size)
        file.seek(place)
        file.write(text.encode())


def refuse_damaged(path: Path) -> tuple[str, ...]:
    """Remarks on a file by its checksum; nothing of one without. Raises `UserError` for a damaged one."""
    with path.open("rb") as file:
        size, place, stated = _found(file)
        if not stated:
            return ()
        checksum, length = int(stated[1], 16), int(stated[2])
        if not length:  # of a file of ours that another program wrote anew
            return ()
        if length != size:
            return (
                f"it had {length} bytes when observer-rt wrote it, and has {size}: changed by another program, "
                "or damaged",
            )
        if _checksum(file, place, size) != checksum:
            raise UserError(
                str(path),
                "is damaged: its bytes contradict its checksum",
                "take another copy; what another program saves of it has no checksum and is read, right or wrong",
            )
    return ()


def _found(file: BinaryIO) -> tuple[int, int, re.Match[bytes] | None]:
    """Size of a file, place of its text, and the text."""
    size = file.seek(0, 2)
    first = file.seek(max(0, size - _END))
    *_, stated = (None, *_STATED.finditer(file.read()))  # the last one: earlier ones may be data
    return size, first + stated.start() if stated else 0, stated


def _checksum(file: BinaryIO, place: int, size: int) -> int:
    """Checksum of a file of a size, its text without checksum."""
    text = _TEXT.format(0, size).encode()
    file.seek(0)
    checksum = left = 0
    for part, left in ((b"", place), (text, size - place - len(text))):
        checksum = zlib.crc32(part, checksum)
        file.seek(len(part), 1)
        while left and (data := file.read(min(left, _AT_ONCE))):
            checksum = zlib.crc32(data, checksum)
            left -= len(data)
    return checksum
