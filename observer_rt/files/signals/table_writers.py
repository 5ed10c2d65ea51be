"""Tables and recordings written part by part, as CSV, MDF4 or Parquet by suffix, in our own layouts."""

import re
from abc import abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, redirect_stdout
from datetime import UTC, datetime
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE, MM3_PER_MS

WRITE_FORMAT = "%.12g"
ROWS_PER_WRITE = 100_000
_NAN = re.compile(r"(?<![^,\n])nan(?=[,\n])")  # a whole cell
_ROW_GROUP = 1 << 17  # rows of Parquet, of which a reader holds all of a column, packed


class WrittenColumn(NamedTuple):
    """A column: its name in text and Parquet, its channel and unit in MDF4, and how it is printed.

    words: of the numbers 0, 1, ... where the column shows words; factor: SI value of one unit.
    """

    header: str
    channel: str
    unit: str = ""
    printed: str = WRITE_FORMAT
    words: tuple[str, ...] = ()
    factor: float = 1.0


class TableWriter(AbstractContextManager["TableWriter"]):
    """A table being written: a context manager that completes the file. The first column is the time [s]."""

    def __init__(self, path: Path, columns: Sequence[WrittenColumn]) -> None:
        self._path = path
        self._columns = columns
        self._stack = ExitStack()

    @abstractmethod
    def write(self, arrays: Sequence[NDArray[Any]]) -> None:
        """Append rows: an array of one length (n,) for every column, nan: not available."""

    def close(self) -> None:
        """Complete the file."""
        self._stack.close()

    def __exit__(self, failure: type[BaseException] | None, *_: object) -> None:
        if failure is None:
            self.close()
        else:  # what cannot be completed is given up, and the failure stays the one that is told
            self._stack.close()


class CsvWriter(TableWriter):
    """CSV with a line of names; NaN is an empty cell."""

    def __init__(self, path: Path, columns: Sequence[WrittenColumn]) -> None:
        super().__init__(path, columns)
        self._file = self._stack.enter_context(path.open("w", encoding="ascii", newline="\n"))
        self._file.write(",".join(column.header for column in columns) + "\n")
        self._format = ",".join(column.printed for column in columns)

    def write(self, arrays: Sequence[NDArray[Any]]) -> None:
        for start in range(0, arrays[0].size, ROWS_PER_WRITE):
            rows = slice(start, start + ROWS_PER_WRITE)
            cells = [
                [column.words[i] for i in values[rows].tolist()] if column.words else values[rows].tolist()
                for column, values in zip(self._columns, arrays, strict=True)
            ]
            self._file.write(_NAN.sub("", "\n".join(map(self._format.__mod__, zip(*cells, strict=True))) + "\n"))


class Mdf4Writer(TableWriter):
    """MDF4, one group, units of their own; the same content gives the same bytes."""

    def __init__(self, path: Path, columns: Sequence[WrittenColumn]) -> None:
        from asammdf import MDF
        from asammdf.blocks.v4_blocks import FileHistory

        super().__init__(path, columns)
        self._file = self._stack.enter_context(MDF(version="4.10"))
        history = FileHistory()
        self._file.start_time = history.time_stamp = datetime.fromtimestamp(0, UTC)  # not when it was written
        history.comment = "<FHcomment><TX>created</TX><tool_id>observer-rt</tool_id></FHcomment>"
        self._file.file_history.append(history)
        self._is_begun = False

    def write(self, arrays: Sequence[NDArray[Any]]) -> None:
        from asammdf import Signal

        time, *values = arrays
        stored = [
            np.asarray(array, np.uint8) if column.words or array.dtype == bool else array
            for column, array in zip(self._columns[1:], values, strict=True)
        ]
        if self._is_begun:
            self._file.extend(0, [(time, None), *((array, None) for array in stored)])
            return
        self._is_begun = True
        signals = [
            Signal(array, time, name=column.channel, unit=column.unit, conversion=_conversion(column.words))
            for column, array in zip(self._columns[1:], stored, strict=True)
        ]
        self._file.append(signals, comment="", common_timebase=True)

    def close(self) -> None:
        quiet = redirect_stdout(StringIO())  # asammdf prints how fast it writes a large one
        with self._path.open("wb+") as handle, quiet:
            self._file.save(handle, add_history_block=False)
        super().close()


class ParquetWriter(TableWriter):
    """Parquet; units are metadata `unit` of the columns, words a dictionary."""

    def __init__(self, path: Path, columns: Sequence[WrittenColumn], facts: Mapping[str, str] | None = None) -> None:
        """facts: further metadata of the file."""
        import pyarrow
        import pyarrow.parquet

        super().__init__(path, columns)
        self._facts = facts or {}
        self._arrow = pyarrow
        self._writer: Any = None

    def write(self, arrays: Sequence[NDArray[Any]]) -> None:
        arrow = self._arrow
        made = [self._array(column, values) for column, values in zip(self._columns, arrays, strict=True)]
        if self._writer is None:
            fields = [
                arrow.field(column.header, array.type, metadata={"unit": column.unit} if column.unit else None)
                for column, array in zip(self._columns, made, strict=True)
            ]
            self._schema = arrow.schema(fields, metadata=self._facts)
            self._writer = self._stack.enter_context(
                arrow.parquet.ParquetWriter(str(self._path), self._schema, write_page_checksum=True)
            )
        self._writer.write_table(arrow.Table.from_arrays(made, schema=self._schema), _ROW_GROUP)

    def _array(self, column: WrittenColumn, values: NDArray[Any]) -> Any:
        if column.words:
            indices = self._arrow.array(np.asarray(values, np.int8))
            return self._arrow.DictionaryArray.from_arrays(indices, list(column.words))
        return self._arrow.array(values)


def _conversion(words: Sequence[str]) -> dict[str, Any] | None:
    if not words:
        return None
    numbers = {f"val_{number}": number for number in range(len(words))}
    return numbers | {f"text_{number}": word.encode() for number, word in enumerate(words)}


TABLE_WRITERS: Mapping[str, Callable[[Path, Sequence[WrittenColumn]], TableWriter]] = {
    ".csv": CsvWriter,
    ".mf4": Mdf4Writer,
    ".parquet": ParquetWriter,
}


TIME = WrittenColumn("time_s", "time", "s")
RAIL_PRESSURE = WrittenColumn("rail_pressure_MPa", "rail_pressure", "MPa", factor=MEGAPASCAL)
NEEDLE_LIFT = WrittenColumn("needle_lift_mm", "needle_lift", "mm", factor=MILLIMETRE)
LINE_PRESSURE = WrittenColumn("line_pressure_MPa", "line_pressure", "MPa", factor=MEGAPASCAL)
INJECTION_RATE = WrittenColumn("injection_rate_mm3_per_ms", "injection_rate", "mm3/ms", factor=MM3_PER_MS)
ENERGIZING = WrittenColumn("energizing", "energizing", "-")
CHAMBER = WrittenColumn("chamber_pressure_MPa", "chamber_pressure", "MPa", factor=MEGAPASCAL)
FUEL = WrittenColumn("fuel_temperature_K", "fuel_temperature", "K")

PRINTED = (TIME, RAIL_PRESSURE, NEEDLE_LIFT, LINE_PRESSURE, INJECTION_RATE, ENERGIZING, CHAMBER, FUEL)
_SI_UNITS = {"MPa": "Pa", "mm": "m", "mm3/ms": "m3/s"}
SI = tuple(  # every double comes back as it was
    WrittenColumn(f"{column.channel}_{unit.replace('/', '_per_')}", column.channel, unit) if unit else column
    for column in PRINTED
    for unit in (_SI_UNITS.get(column.unit),)
)
TRUTH = (  # of a simulation
    *(TIME, INJECTION_RATE, NEEDLE_LIFT, LINE_PRESSURE),
    WrittenColumn("sac_pressure_MPa", "sac_pressure", factor=MEGAPASCAL),
    WrittenColumn("line_flow_mm3_per_ms", "line_flow", factor=MM3_PER_MS),
)
_LAYOUTS = {".csv": PRINTED, ".mf4": SI, ".parquet": SI}


@contextmanager
def recording_writer(path: Path, recorded: Collection[str]) -> Iterator[Callable[[Recording], None]]:
    """Writes parts, which have the `recorded` signals, in our layout of the suffix, replacing an existing file."""
    suffix = path.suffix.lower()
    columns = [column for column in _LAYOUTS[suffix] if column.channel in ("time", *recorded)]
    with TABLE_WRITERS[suffix](path, columns) as writer:

        def write(part: Recording) -> None:
            arrays = part.arrays
            writer.write([arrays[column.channel] / column.factor for column in columns])

        yield write
