"""Columns of Arrow by their names, with units from the metadata: of Parquet files, and of tables in memory."""

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from observer_rt.config.injector_sections import RecordingConfig
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE
from observer_rt.files.signals.table import TIME, FileTable, Heading, Table, TablePart, find_columns
from observer_rt.files.signals.time_axis import NO_MOMENT, seconds_since
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import NANOSECONDS, NANOSECONDS_PER_MS, NANOSECONDS_PER_US, Floats, Ints

READABLE = "give a complete Parquet file"
_OF_DAY = "time32", "time64"  # types whose values may pass midnight
_NANOSECONDS = {"s": NANOSECONDS, "ms": NANOSECONDS_PER_MS, "us": NANOSECONDS_PER_US, "ns": 1}  # by units of stamps


class ArrowTable(Table):
    """Columns by their names; units from the metadata `unit`. Null is "not available"; times count from the first."""

    def __init__(self, path: Path, config: RecordingConfig, schema: Any, is_own: bool = False) -> None:
        super().__init__(path, config, is_own)
        self.mapped = find_columns(path, self._wanted(), schema.names, is_own)
        self.columns = {field.name: _unit(field) for field in schema}
        self.units = {name: unit for name, column in self.mapped.items() if (unit := self.columns[column.column])}
        self.rasters = (tuple(name for name in self.mapped if name != TIME),)
        self.layout = f"{len(schema.names)} columns"
        self._origin = 0
        if TIME in self.mapped and _is_calendar(schema.field(self.mapped[TIME].column).type):
            self.units[TIME] = "s"
            moments = (_moments(batch.column(0)) for batch in self._batches([self.mapped[TIME].column]))
            stamped = (moment[moment != NO_MOMENT] for moment in moments)
            self._origin = next((int(moment[0]) for moment in stamped if moment.size), 0)
            dated = str(schema.field(self.mapped[TIME].column).type).startswith("timestamp")
            self.origin = self._origin / NANOSECONDS if dated else 0.0

    @abstractmethod
    def _batches(self, names: Sequence[str]) -> Iterator[Any]:
        """Record batches of some columns, in that order, read anew."""

    def parts(self, raster: int) -> Iterator[TablePart]:
        names = list(dict.fromkeys(column.column for column in self.mapped.values()))
        row = 0
        for batch in self._batches(names):
            columns = {name: self._numbers(batch.column(place), name) for place, name in enumerate(names)}
            yield self._part({name: columns[column.column] for name, column in self.mapped.items()}, row)
            row += batch.num_rows

    def location(self, row: int, raster: int) -> str:
        return f"{self.path}, row {row}"

    def _numbers(self, column: Any, name: str) -> Floats:
        """Raises `UserError` for other types than numbers and times."""
        import pyarrow

        if _is_calendar(column.type):
            return seconds_since(self._origin, _moments(column), str(column.type).startswith(_OF_DAY))
        if not _is_number(column.type):
            location = f"{self.path}, column {name}"
            raise UserError(location, f"holds {column.type}, no numbers", "map a column of numbers")
        return np.array(column.cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False), np.float64)


class ParquetTable(ArrowTable, FileTable):
    """A Parquet file."""

    def __init__(self, path: Path, config: RecordingConfig, is_own: bool = False) -> None:
        with _open_parquet(path) as file:
            super().__init__(path, config, file.schema_arrow, is_own)

    @staticmethod
    def headings(path: Path) -> Sequence[Heading]:
        with _open_parquet(path) as file:
            return headings_of(file.schema_arrow)

    def _batches(self, names: Sequence[str]) -> Iterator[Any]:
        with _open_parquet(self.path) as file:
            # one thread: those of a pool would keep 25 MB, and are no faster for so few rows
            for batch in file.iter_batches(SAMPLES_AT_ONCE, columns=list(names), use_threads=False):
                yield batch.select(list(names))


def headings_of(schema: Any) -> list[Heading]:
    """Headings of the columns of numbers and moments of an Arrow schema."""
    return [
        Heading(field.name, _unit(field), None, _is_calendar(field.type))
        for field in schema
        if _is_calendar(field.type) or _is_number(field.type)
    ]


def _is_calendar(kind: Any) -> bool:
    return str(kind).startswith(("timestamp", "duration", *_OF_DAY))


def _is_number(kind: Any) -> bool:
    from pyarrow import types

    return any(check(kind) for check in (types.is_integer, types.is_floating, types.is_decimal, types.is_boolean))


def _moments(column: Any) -> Ints:
    import pyarrow

    stamps = column.cast(f"int{column.type.bit_width}").cast(pyarrow.int64())
    result: Ints = stamps.fill_null(0).to_numpy(zero_copy_only=False) * _NANOSECONDS[column.type.unit]
    return np.where(stamps.is_valid().to_numpy(zero_copy_only=False), result, NO_MOMENT)


@contextmanager
def _open_parquet(path: Path) -> Iterator[Any]:
    """A file to read. Raises `UserError` for a damaged one."""
    with path.open("rb"):  # whose errors are the usual ones; pyarrow reads its own files faster
        pass
    import pyarrow
    import pyarrow.parquet

    try:
        with (
            pyarrow.OSFile(str(path)) as opened,
            pyarrow.parquet.ParquetFile(opened, pre_buffer=False, page_checksum_verification=True) as file,
        ):
            yield file
    except (pyarrow.ArrowException, OSError, ValueError) as error:
        raise UserError(str(path), f"a damaged Parquet file: {error}", READABLE) from None


def _unit(field: Any) -> str:
    metadata: Mapping[bytes, bytes] = field.metadata or {}
    return metadata.get(b"unit", b"").decode("utf-8", "replace").strip()
