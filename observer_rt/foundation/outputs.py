"""Outputs: one rule for every file and folder that a command writes.

A file that is there is replaced with --force only, and only if it holds the kind of content that is written. A folder
is filled, never emptied.
"""

import os
import re
import tempfile
from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple

from observer_rt.foundation.errors import UserError, file_errors, require
from observer_rt.foundation.files import check_suffix

FIGURE_SUFFIXES = (".png", ".svg", ".pdf")
_HEAD = 4096  # bytes of a file's beginning, by which its kind is known
IN_A_CALL = "give force=True"
"""How a user of the library asks for what --force is on the command line."""


class FileKind(NamedTuple):
    """A kind of file: its name with an article, and how a file of it begins."""

    name: str
    beginning: re.Pattern[bytes]


def _kind(name: str, beginning: bytes) -> FileKind:
    return FileKind(name, re.compile(beginning, re.MULTILINE))


LEARNED_STATE = _kind(
    "a learned state",
    rb'\A\s*\{\s*"version":\s*\d|"package_version":\s*"[^"]*",\s*"model_sha256":'
    rb'|\A\s*\{\s*("v?e?r?s?i?o?n?"?:?\s*)?\Z',  # cut off at once
)
JOURNAL = _kind("a journal of injections", rb"\ASQLite format 3\0")
SERVICE_LOG = _kind("a log of `observer-rt run`", rb"^\d{4}-\d\d-\d\dT[\d:.]+[+-]\d\d:\d\d [A-Z]+ [a-z]+: ")
INJECTOR_FILE = _kind("an injector file", rb"^\[(fluid|line|seat|nozzle|chamber)\]")
BENCH_FILE = _kind("a bench file", rb"^\[{1,2}(dbc|link|links|signals|outputs|recording|injectors)[].]")
TABLE = _kind("a table of samples", rb"\A(\xef\xbb\xbf)?time_s,")
FINDINGS = _kind("the findings of `discover`", rb'\A\{\s*"schema":\s*\d')
REPRODUCTION = _kind("a table of `reproduce`", rb"\Av_H,x3_mse_")
_BY_SUFFIX = {
    ".csv": TABLE,
    ".parquet": _kind("a Parquet file", rb"\APAR1"),
    ".mf4": _kind("an MDF file", rb"\A(MDF     |UnFinMF )"),
    ".log": _kind("a log of candump", rb"^\s*\(\d+\.\d+\) "),
    ".blf": _kind("a log of Vector, binary", rb"\ALOGG"),
    ".asc": _kind("a log of Vector, text", rb"\Adate "),
    ".trc": _kind("a log of PEAK", rb"\A;\$FILEVERSION"),
    ".toml": INJECTOR_FILE,
    ".html": _kind("a page", rb"\A\s*<!(DOCTYPE|doctype) html"),
    ".png": _kind("a PNG figure", rb"\A\x89PNG"),
    ".svg": _kind("an SVG figure", rb"\A\s*<(\?xml|svg)"),
    ".pdf": _kind("a PDF figure", rb"\A%PDF"),
}
_KINDS = (LEARNED_STATE, JOURNAL, SERVICE_LOG, BENCH_FILE, FINDINGS, *_BY_SUFFIX.values())


def refuse_other_kind(option: str, path: Path, wanted: FileKind | None = None) -> None:
    """Raise `UserError` naming the option where a file is there that we would not have written.

    wanted: by default what its suffix stands for; an unknown suffix, of an installed format, may hold anything.
    An empty file, or one of zeros as a crash leaves it, may be replaced.
    """
    wanted = wanted or _BY_SUFFIX.get(path.suffix.lower())
    if wanted is None or not path.is_file():
        return
    with file_errors(path), path.open("rb") as file:
        content = file.read(_HEAD)
    if not content.strip(b"\0") or wanted.beginning.search(content):
        return
    actual = next((kind.name for kind in _KINDS if kind.beginning.search(content)), "something else")
    problem = f"holds {actual}, not {wanted.name}, and stays as it is"
    raise UserError(f"{option} {path}", problem, "name another file, or move this one away")


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
        problem = f"no file can be made there: {error.strerror}"
        raise UserError(location, problem, "check the folder, or name another") from None


def make_folder(option: str, folder: Path) -> None:
    """Make a folder for outputs, if it is not there. Raises `UserError` where it cannot be made or filled."""
    if folder.exists() and not folder.is_dir():
        raise UserError(f"{option} {folder}", "is a file", "name a folder")
    with file_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    check_folder(option, folder)
