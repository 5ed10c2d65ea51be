"""MDF4 files are read in a process of their own: asammdf trusts what stands in them."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.file_errors import file_errors
from observer_rt.foundation.sandbox import WorkerError, run_apart

READABLE = "give a complete MDF 4 measurement"


def mdf4_apart(module: str, function: str, path: Path, *arguments: Any) -> Iterator[Any]:
    """As `run_apart`; a reader that crashes is damage of the file. Raises `UserError` naming the file."""
    try:
        with file_errors(path):
            yield from run_apart(module, function, path, *arguments)
    except WorkerError as error:
        raise UserError(str(path), f"a damaged MDF file: {error}", READABLE) from None
