"""Reads a file whole by the library that knows it, in a process of its own, for it trusts what stands in a file."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from observer_rt.files.signals.column import Column, column_of
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.sandbox import WorkerError, run_apart

READERS = "observer_rt.files.whole"


def require(path: Path, library: str, package: str) -> None:
    """Raise `UserError` where the library that reads a file is missing. package: what is installed for it."""
    if find_spec(library) is None:
        raise UserError(
            str(path),
            f"is read by {package}, which is not installed",
            f"pip install {package}, or pip install 'observer-rt[files]'",
        )


def plain_columns(path: Path, module: str) -> Iterator[tuple[Any, ...]]:
    """Fields of the columns that a module of `files.whole` reads; to be run apart."""
    for column in import_module(f"{READERS}.{module}").columns(path):
        values = column.cells if column.values.dtype.kind == "O" else column.values
        yield column.name, values, column.unit, column.time, column.group


@dataclass(frozen=True)
class WholeFile:
    """Kind of files read whole. module: of `files.whole`, whose `columns(path)` yields them; library: what that
    imports, package: what is installed for it."""

    name: str
    module: str
    library: str
    package: str

    def columns(self, path: Path) -> Sequence[Column]:
        """All columns of a file. Raises `UserError` for a damaged one, and where the library is missing."""
        require(path, self.library, self.package)
        with path.open("rb"):  # whose errors are the usual ones
            pass
        try:
            found = [column_of(each) for each in run_apart(__name__, "plain_columns", path, self.module)]
        except (WorkerError, OSError) as error:
            raise UserError(
                str(path), f"a damaged {self.name} file: {error}", f"give a complete {self.name} file"
            ) from None
        if not found:
            raise UserError(
                str(path),
                f"this {self.name} file holds no column of numbers",
                "write plain arrays of numbers, one a signal, or export CSV or Parquet",
            )
        return found
