"""Files read and written: suffixes, hashes, encodings, and replacement in one step.

A file is written under another name in its folder and then renamed, so that the old or the new one is always whole.
"""

import codecs
import hashlib
import os
import secrets
import shutil
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from observer_rt.foundation.errors import RunError, UserError, file_errors


def check_suffix(location: str, path: Path, suffixes: Collection[str]) -> None:
    """Raise `UserError` at `location` for a file whose suffix is not one of these."""
    suffix = path.suffix.lower()
    if suffix not in suffixes:
        raise UserError(location, f"unknown kind of file '{suffix}'", f"known suffixes: {', '.join(suffixes)}")


def is_at(path: Path, file: os.stat_result) -> bool:
    """Whether the file of a path is the one that was opened; file: its `os.fstat`."""
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
    """A new file in the folder of the target, which replaces it once complete and on the disk, else is deleted.

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
    """Write a whole file. Raises `UserError` or `RunError`; the file that was there is then unchanged."""
    with file_errors(target), replacing(target) as part:
        part.write_text(text, encoding="utf-8")


def begin_stream(path: Path, force: bool) -> None:
    """Make the empty file of a growing stream; force: empty an earlier one. Raises `RunError` for another."""
    with file_errors(path):
        path.open("w" if force else "x").close()


def to_disk(path: Path) -> None:
    """Wait until a file, or the names in a folder, have reached the disk. Raises OSError."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
