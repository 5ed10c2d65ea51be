"""Refusing, before the work begins, a file of no known kind or one that could not be written once it is done."""

import os
import tempfile
from collections.abc import Collection, Iterable
from pathlib import Path

from observer_rt.foundation.errors import UserError

FIGURE_SUFFIXES = (".png", ".svg", ".pdf")


def check_destination(option: str, path: Path, suffixes: Collection[str] = ()) -> None:
    """Check that a file can be written, or replaced, at `path`; `suffixes`: the kinds known, empty for any.

    Raises `UserError` that names the command line's option.
    """
    place = f"{option} {path}"
    if suffixes:
        check_suffix(place, path, suffixes)
    if path.is_dir():
        raise UserError(place, "is a folder", "name a file")
    if path.exists() and not os.access(path, os.W_OK):
        raise UserError(place, "must not be written", "check its rights, or name another file")
    if not path.exists():
        check_folder(option, path.parent)


def refuse_existing(option: str, paths: Iterable[Path], force: bool) -> None:
    """Raise `UserError` for a file that would be replaced although nobody said --force."""
    for path in paths:
        if path.exists() and not force:
            raise UserError(f"{option} {path}", "exists already", "name another file, or add --force")


def check_suffix(place: str, path: Path, suffixes: Collection[str]) -> None:
    """Raise `UserError` for a file whose suffix is not among those known."""
    if path.suffix.lower() not in suffixes:
        raise UserError(
            place, f"unknown kind of file '{path.suffix}'", f"known suffixes: {', '.join(suffixes)}"
        )


def check_folder(option: str, folder: Path) -> None:
    """Check that files can be made in an existing folder. Raises `UserError` that names the option."""
    place = f"{option}: {folder}"
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except FileNotFoundError:
        raise UserError(place, "no such folder", "create it first, or correct the path") from None
    except OSError as error:
        raise UserError(
            place, f"no file can be made there: {error.strerror}", "check the folder, or name another"
        ) from None
