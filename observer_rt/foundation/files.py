"""Files read and written: hashes, encodings, and replacement in one step.

A file is written beside its place and renamed, so whenever the program ends, the old or the new file is whole.
"""

import codecs
import hashlib
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from observer_rt.foundation.errors import RunError, UserError, file_errors


def is_at(path: Path, file: os.stat_result) -> bool:
    """Whether a file that was opened is the one that is there now."""
    try:
        return os.path.samestat(path.stat(), file)
    except FileNotFoundError:
        return False


def file_hash(path: Path) -> str:
    """SHA-256 of a file's content, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def encoding_of(begin: bytes) -> str:
    """Encoding of a text by its beginning: its byte order mark, else UTF-8 where it is that, else cp1252."""
    if begin.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    try:
        codecs.getincrementaldecoder("utf-8-sig")().decode(begin)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8-sig"


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A new file beside the target, which takes its place once it is complete and on the disk, and else is gone.

    A link stays a link. Raises OSError, and `UserError` for a device or a pipe, which must not be replaced.
    """
    final = Path(os.path.realpath(target))
    if final.exists() and not final.is_file():
        raise UserError(str(target), "is no file", "name a file")
    part = final.with_name(f".{final.stem}.{secrets.token_hex(4)}.part{target.suffix}")
    try:
        yield part
        with suppress(FileNotFoundError):
            shutil.copymode(final, part)
        to_disk(part)
        part.replace(final)
    except UserError as error:
        raise UserError(error.location.replace(str(part), str(target)), error.problem, error.remedy) from None
    except RunError as error:
        raise RunError(str(error).replace(str(part), str(target))) from error
    finally:
        part.unlink(missing_ok=True)
    with suppress(OSError):  # not every file system lets one do so
        to_disk(final.parent)


def write_text(target: Path, text: str) -> None:
    """Write a whole file. Raises `UserError`, `RunError`; what was there is then unchanged."""
    with file_errors(target), replacing(target) as part:
        part.write_text(text, encoding="utf-8")


def begin_stream(path: Path, force: bool) -> None:
    """Make the empty file of a stream, which grows while it is recorded, and which no rename can complete.

    force: an earlier file is emptied. Raises `RunError` for a file that came meanwhile.
    """
    with file_errors(path):
        path.open("w" if force else "x").close()


def to_disk(path: Path) -> None:
    """Wait until a file, or the names in a folder, have reached the disk. Raises OSError."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
