"""Parquet: columns by their names, with units from the metadata."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from observer_rt.config.injector import RecordingConfig
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE
from observer_rt.files.signals.table import TIME, FileTable, Heading, TablePart, Values, present
from observer_rt.foundation.errors import UserError

READABLE = "give a complete Parquet file"


class ParquetTable(FileTable):
    """Columns by their names; units from the fields' metadata `unit`. Null is "not available".

    A column of calendar stamps is in seconds.
    """

    def __init__(self, path: Path, config: RecordingConfig, is_own: bool = False) -> None:
        super().__init__(path, config, is_own)
        wanted = self._wanted()
        with _opened(path) as file:
            schema = file.schema_arrow
        self.mapped = present(path, wanted, schema.names, is_own)
        self.columns = {field.name: _unit(field.metadata) for field in schema}
        self.units = {name: unit for name, each in self.mapped.items() if (unit := self.columns[each.name])}
        if TIME in self.mapped and _is_calendar(schema.field(self.mapped[TIME].name).type):
            self.units[TIME] = "s"
        self.rasters = (tuple(name for name in self.mapped if name != TIME),)
        self.layout = f"Parquet, {len(schema.names)} columns"

    @staticmethod
    def headings(path: Path) -> Sequence[Heading]:
        """Headings of the columns of numbers and moments."""
        with _opened(path) as file:
            return [
                Heading(each.name, _unit(each.metadata), None, _is_calendar(each.type))
                for each in file.schema_arrow
                if _is_calendar(each.type) or _is_number(each.type)
            ]

    def parts(self, raster: int) -> Iterator[TablePart]:
        """Batches of rows."""
        names = list(dict.fromkeys(column.name for column in self.mapped.values()))
        row = 0
        with _opened(self.path) as file:
            # one thread: those of a pool would keep 25 MB, and are no faster for so few rows
            for batch in file.iter_batches(SAMPLES_AT_ONCE, columns=names, use_threads=False):
                columns = {
                    name: _numbers(batch.column(name), f"{self.path}, column {name}") for name in names
                }
                yield self._part({name: columns[each.name] for name, each in self.mapped.items()}, row)
                row += batch.num_rows

    def location(self, row: int, raster: int) -> str:
        """Place of a row in the file: its number."""
        return f"{self.path}, row {row}"


def _is_calendar(kind: Any) -> bool:
    return str(kind).startswith(("timestamp", "duration"))


def _is_number(kind: Any) -> bool:
    import pyarrow

    types = pyarrow.types
    return bool(types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind))


def _numbers(column: Any, location: str) -> Values:
    """An array of Arrow as doubles; stamps of a calendar as seconds. Raises `UserError` for other types."""
    import pyarrow

    kind = column.type
    if _is_calendar(kind):
        scale = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind.unit]
        return _doubles(column.cast(pyarrow.int64())) * scale
    if not _is_number(kind):
        raise UserError(location, f"holds {kind}, no numbers", "map a column of numbers")
    return _doubles(column)


def _doubles(column: Any) -> Values:
    import pyarrow

    return np.array(column.cast(pyarrow.float64(), safe=False).to_numpy(zero_copy_only=False), np.float64)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
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


def _unit(metadata: dict[bytes, bytes] | None) -> str:
    return (metadata or {}).get(b"unit", b"").decode("utf-8", "replace").strip()
