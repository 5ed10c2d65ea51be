"""Parquet, by pyarrow (`pip install observer-rt[parquet]`): a layout of our own, and the opening of any."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.misspelt import hint
from observer_rt.recording.signals.checked import GridSignals
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.stream import SAMPLES_AT_ONCE

COLUMNS = {  # in SI units, so that every double comes back as it was
    "time_s": "time",
    "rail_pressure_Pa": "rail_pressure",
    "needle_lift_m": "needle_lift",
    "line_pressure_Pa": "line_pressure",
    "injection_rate_m3_per_s": "injection_rate",
}
OPTIONAL = "injection_rate_m3_per_s"
INSTALL = "pip install 'observer-rt[parquet]'"
READABLE = "give a complete Parquet file"


class ParquetSignals(GridSignals):
    """A recording by the names of its columns, further ones are ignored; null is "not available"."""

    def __init__(self, path: Path, in_one_go: bool = False) -> None:
        super().__init__(path, in_one_go)
        names = parquet_names(path)
        for name in COLUMNS:
            if name not in names and name != OPTIONAL:
                raise UserError(
                    str(path),
                    f"column '{name}' is missing{hint(name, names)}",
                    f"name the columns {', '.join(COLUMNS)} (the last optional), or say in [recording] of a bench "
                    "file which is which",
                )
        self._columns = [name for name in COLUMNS if name in names]
        self._look()

    def _place(self, row: int) -> str:
        return f"{self._file}, row {row}"

    def _parts(self) -> Iterator[dict[str, NDArray[np.float64]]]:
        for columns in batches(self._file, self._columns):
            yield {COLUMNS[name]: values for name, values in columns.items()}


def read_parquet(path: Path) -> Recording:
    """Read a recording, as `ParquetSignals`."""
    return ParquetSignals(path).collected()


def parquet_names(path: Path) -> list[str]:
    """Of the columns."""
    with opened_parquet(path) as file:
        return list(file.schema_arrow.names)


def batches(path: Path, names: list[str]) -> Iterator[dict[str, NDArray[np.float64]]]:
    """Columns as numbers, some rows at a time; null becomes NaN. Raises `UserError` for what is none."""
    with opened_parquet(path) as file:
        # one thread: those of a pool would keep 25 MB, and are no faster for so few rows
        for batch in file.iter_batches(SAMPLES_AT_ONCE, columns=names, use_threads=False):
            yield {name: numbers(batch.column(name), f"{path}, column {name}") for name in names}


def numbers(column: Any, place: str) -> NDArray[np.float64]:
    """An array of Arrow as doubles; stamps of a calendar as seconds."""
    import pyarrow

    kind = column.type
    if pyarrow.types.is_timestamp(kind) or pyarrow.types.is_duration(kind):
        scale = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind.unit]
        return _doubles(column.cast(pyarrow.int64())) * scale
    if not (
        pyarrow.types.is_integer(kind) or pyarrow.types.is_floating(kind) or pyarrow.types.is_decimal(kind)
    ):
        raise UserError(place, f"holds {kind}, no numbers", "map a column of numbers")
    return _doubles(column)


def _doubles(column: Any) -> NDArray[np.float64]:
    import pyarrow

    values: NDArray[np.float64] = column.cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False)
    return np.array(values, dtype=np.float64)


@contextmanager
def opened_parquet(path: Path) -> Iterator[Any]:
    """A file to read. Raises `UserError` for a damaged one, and where pyarrow is not installed."""
    with path.open("rb"):  # whose errors are the usual ones; pyarrow reads its own files faster
        pass
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise UserError(str(path), "is read by pyarrow, which is missing", INSTALL) from None
    try:
        with (
            pyarrow.OSFile(str(path)) as opened,
            pyarrow.parquet.ParquetFile(opened, pre_buffer=False) as file,
        ):
            yield file
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise UserError(str(path), f"a damaged Parquet file: {error}", READABLE) from None
