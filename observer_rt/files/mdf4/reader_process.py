"""The process in which asammdf reads an MDF4 file: it trusts what stands in a file, and damaged ones crash it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from observer_rt.foundation.errors import UserError, require
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.sandbox import WorkerError, run_apart

READABLE = "give a complete MDF 4 measurement"
MAGICS = (b"MDF     ", b"UnFinMF ")  # complete, and as a logger leaves it
MAJOR_VERSION = b"4."


def mdf4_apart(module: str, function: str, path: Path, *arguments: Any) -> Iterator[Any]:
    """Call `run_apart`; a reader that crashes is damage of the file. Raises `UserError` naming the file."""
    require("asammdf")
    with crash_told(path), file_errors(path):
        yield from run_apart(module, function, path, *arguments)


@contextmanager
def crash_told(path: Path) -> Iterator[None]:
    """Turn `WorkerError` of a reader, or of the use of its answers, into `UserError`."""
    try:
        yield
    except WorkerError as error:
        raise UserError(str(path), f"a damaged MDF file: {error}", READABLE) from None


def refuse_other_files(path: Path) -> None:
    """Raise `UserError` for a file that is not MDF of version 4."""
    with path.open("rb") as file:
        mark, version = file.read(len(MAGICS[0])), file.read(len(MAJOR_VERSION))
    if mark not in MAGICS:
        raise UserError(str(path), "not an MDF file", READABLE)
    if version != MAJOR_VERSION:
        raise UserError(str(path), f"is of MDF {version.decode('ascii', 'replace')}, not 4", READABLE)
