"""Outputs: one rule for every file and folder that a command writes.

A file that is there is replaced with --force only, and only if it holds the kind of content that is written. It is
written beside its place and renamed, so whenever the program ends, the old or the new file is whole. A folder is
filled, never emptied.
"""

import os
import secrets
import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from observer_rt.foundation.console import FIGURE_SUFFIXES, check_suffix
from observer_rt.foundation.errors import RunError, UserError, require
from observer_rt.foundation.files import FileKind, file_errors, refuse_other_kind

IN_A_CALL = "give force=True"
"""How a user of the library asks for what --force is on the command line."""


def check_output(
    option: str,
    path: Path,
    force: bool,
    kind: FileKind | None = None,
    suffixes: Collection[str] = (),
    consent: str = "add --force",
) -> None:
    """Check, before the work, that a file can be written and takes no other's place.

    force: a file of the same kind may be there, which the user asks for by `consent`; kind: by default that of the
    suffix; suffixes: those known, empty for any.

    Raises `UserError` that names the option of the command line.
    """
    if suffixes:
        check_suffix(f"{option} {path}", path, suffixes)
    if path.suffix in FIGURE_SUFFIXES:
        require("matplotlib")
    check_own_file(option, path, kind)
    if path.exists() and not force:
        raise UserError(f"{option} {path}", "exists already", f"name another file, or {consent}")
    check_folder(option, path.parent)


def check_own_file(option: str, path: Path, kind: FileKind | None = None) -> None:
    """Check a file that a command goes on with: an existing one is of this kind. Raises `UserError`."""
    location = f"{option} {path}"
    if path.is_dir():
        raise UserError(location, "is a folder", "name a file")
    if not path.exists():
        check_folder(option, path.parent)
    elif not path.is_file():
        raise UserError(location, "is no file", "name a file")
    elif not os.access(path, os.W_OK):
        raise UserError(location, "must not be written", "check its rights, or name another file")
    else:
        refuse_other_kind(option, path, kind)


def check_folder(option: str, folder: Path) -> None:
    """Check that files can be made in an existing folder. Raises `UserError` that names the option."""
    location = f"{option}: {folder}"
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except FileNotFoundError:
        raise UserError(location, "no such folder", "create it first, or correct the path") from None
    except OSError as error:
        raise UserError(
            location, f"no file can be made there: {error.strerror}", "check the folder, or name another"
        ) from None


def make_folder(option: str, folder: Path) -> None:
    """Make a folder for outputs, if it is not there. Raises `UserError` where it cannot be made or filled."""
    if folder.exists() and not folder.is_dir():
        raise UserError(f"{option} {folder}", "is a file", "name a folder")
    with file_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    check_folder(option, folder)


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
    """Make the empty file of a stream that grows as long as it is recorded, which no rename can complete.

    force: an earlier stream is given up for it. Raises `RunError` for a file that came meanwhile.
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
