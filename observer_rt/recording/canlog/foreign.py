"""What a file that is not what its name says looks like: for messages."""

import gzip
import zlib
from contextlib import suppress
from pathlib import Path

GZIP_MARK = b"\x1f\x8b"
_HEAD = 200  # bytes
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
)
_UNREAD = (
    (b"Time Stamp,ID,", "a log of SavvyCAN"),
    (b"timestamp,arbitration_id", "python-can's .csv"),
    (b"SQLite format 3", "a database, as python-can's .db"),
    (b"CAN Record", "a log of Kvaser's tools"),
    (b"Kvaser", "a log of Kvaser's tools"),
    (b"\xff\xfe", "text in UTF-16"),
    (b"PK\x03\x04", "a zip archive"),
)


def head_of(path: Path) -> bytes:
    """How a file begins, that of a packed one unpacked. Raises `OSError` for a file that cannot be opened."""
    with path.open("rb") as file:
        head = file.read(_HEAD)
        if head.startswith(GZIP_MARK):
            file.seek(0)
            with suppress(OSError, EOFError, zlib.error):
                head = gzip.GzipFile(fileobj=file).read(_HEAD)
    return head.removeprefix(b"\xef\xbb\xbf")


def likeness(path: Path) -> tuple[str, str]:
    """What a file looks like and what to do about it, for the ends of problem and remedy; empty if unknown."""
    head = head_of(path).lstrip()
    for mark, name, suffix in _READ:
        if head.startswith(mark) and path.suffix.lower() != suffix:
            return f"; it looks like {name}", f"name it so: {path.stem}{suffix}"
    for mark, name in _UNREAD:
        if head.startswith(mark):
            return f"; it looks like {name}", "export it as .asc, .blf or .trc from the program that wrote it"
    return "", ""
