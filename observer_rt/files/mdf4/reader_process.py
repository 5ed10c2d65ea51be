"""The process in which asammdf reads an MDF4 file: it trusts what stands in a file, and damaged ones crash it."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

from pydantic import TypeAdapter

from observer_rt.foundation.errors import UserError, require
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.sandbox import WorkerError, checked, run_apart

READABLE = "give a complete MDF 4 measurement"
T = TypeVar("T")


def mdf4_apart(module: str, function: str, path: Path, kind: TypeAdapter[T], *arguments: Any) -> Iterator[T]:
    """Answers of `run_apart`, each of a kind; a reader that crashes or answers otherwise is damage of the file.

    Raises `UserError` naming the file.
    """
    require("asammdf")
    with file_errors(path), path.open("rb"):  # whose errors are the usual ones
        pass
    try:
        for answer in run_apart(module, function, path, *arguments):
            yield checked(kind, answer)
    except WorkerError as error:
        raise UserError(str(path), f"a damaged MDF file: {error}", READABLE) from None
