"""Text files of recordings, plain or packed with gzip: encoding, lines, end."""

import gzip
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from io import TextIOWrapper
from pathlib import Path
from typing import BinaryIO, TextIO, cast

from observer_rt.foundation.console import PACKED
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import encoding_of

_HEAD = 1 << 16  # bytes that tell the encoding


@contextmanager
def opened_bytes(path: Path) -> Iterator[BinaryIO]:
    """Content of a file, unpacked. Raises `UserError` where it is packed and damaged."""
    if path.suffix.lower() != PACKED:
        with path.open("rb") as plain:
            yield plain
        return
    try:
        with path.open("rb") as packed, gzip.GzipFile(fileobj=packed) as file:
            yield cast(BinaryIO, file)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise UserError(
            str(path), f"a damaged gzip file: {error}", "pack it again, or give it unpacked"
        ) from None


@contextmanager
def opened_text(path: Path, encoding: str) -> Iterator[TextIO]:
    """Lines of a file, bytes that are no text replaced."""
    with opened_bytes(path) as file, TextIOWrapper(file, encoding, errors="replace") as text:
        yield text


def encoding_of_file(path: Path) -> str:
    """Encoding of a file by its beginning."""
    with opened_bytes(path) as file:
        return encoding_of(file.read(_HEAD))


def tail_of(path: Path, size: int) -> bytes:
    """The last bytes of a file."""
    with opened_bytes(path) as file:
        if path.suffix.lower() != PACKED:
            file.seek(max(0, path.stat().st_size - size))
            return file.read()
        tail = b""
        while part := file.read(_HEAD):
            tail = (tail + part)[-size:]
        return tail
