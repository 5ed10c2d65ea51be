"""Tables and recordings written part by part, as CSV, MDF4 or Parquet by suffix, in our own layouts."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE, MM3_PER_MS
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.stream import joined

WRITE_FORMAT = "%.12g"
ROWS_PER_WRITE = 100_000
_ROW_GROUP = 1 << 17  # rows of Parquet, of which whoever reads them holds all of a column, packed


@dataclass(frozen=True)
class WrittenColumn:
    """A column: its name in text and Parquet, as a channel of MDF4 with its unit, and how it is printed.

    words: of the numbers 0, 1, ... where the column says words.
    """

    header: str
    channel: str
    unit: str = ""
    printed: str = WRITE_FORMAT
    words: tuple[str, ...] = ()


class TableWriter(ABC):
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

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class CsvWriter(TableWriter):
    """CSV with a line of names; NaN is an empty cell."""

    def __init__(self, path: Path, columns: Sequence[WrittenColumn]) -> None:
        super().__init__(path, columns)
        self._file = self._stack.enter_context(path.open("w", encoding="ascii", newline="\n"))
        self._file.write(",".join(column.header for column in columns) + "\n")
        self._format = ",".join(column.printed for column in columns)

    def write(self, arrays: Sequence[NDArray[Any]]) -> None:
        """Append lines."""
        for start in range(0, arrays[0].size, ROWS_PER_WRITE):
            rows = slice(start, start + ROWS_PER_WRITE)
            cells = [
                [column.words[i] for i in values[rows].tolist()] if column.words else values[rows].tolist()
                for column, values in zip(self._columns, arrays, strict=True)
            ]
            text = "\n".join(map(self._format.__mod__, zip(*cells, strict=True))) + "\n"
            self._file.write(text.replace("nan", ""))


class Mdf4Writer(TableWriter):
    """MDF4, one group, units of their own; the same content gives the same bytes."""

    def __init__(self, path: Path, columns: Sequence[WrittenColumn]) -> None:
        from asammdf import MDF

        from observer_rt.recording.signals.mdf4_file import add_history

        super().__init__(path, columns)
        self._file = MDF(version="4.10")
        add_history(self._file)
        self._is_begun = False

    def write(self, arrays: Sequence[NDArray[Any]]) -> None:
        """Append samples."""
        from asammdf import Signal

        time, *values = arrays
        stored = [np.asarray(array, np.uint8) if array.dtype.kind in "bi" else array for array in values]
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
        """Write the file."""
        quiet = redirect_stdout(StringIO())  # asammdf prints how fast it writes a large one
        with self._file, self._path.open("wb+") as handle, quiet:
            self._file.save(handle, add_history_block=False)


class ParquetWriter(TableWriter):
    """Parquet; units are metadata `unit` of the columns, words a dictionary."""

    def __init__(self, path: Path, columns: Sequence[WrittenColumn]) -> None:
        super().__init__(path, columns)
        try:
            import pyarrow
            import pyarrow.parquet
        except ImportError:
            raise UserError(
                str(path), "is written by pyarrow, which is missing", "pip install 'observer-rt[parquet]'"
            ) from None
        self._arrow = pyarrow
        self._writer: Any = None

    def write(self, arrays: Sequence[NDArray[Any]]) -> None:
        """Append row groups."""
        arrow = self._arrow
        made = [self._array(column, values) for column, values in zip(self._columns, arrays, strict=True)]
        if self._writer is None:
            fields = [
                arrow.field(
                    column.header, array.type, metadata={"unit": column.unit} if column.unit else None
                )
                for column, array in zip(self._columns, made, strict=True)
            ]
            self._schema = arrow.schema(fields)
            self._writer = self._stack.enter_context(
                arrow.parquet.ParquetWriter(str(self._path), self._schema)
            )
        self._writer.write_table(arrow.Table.from_arrays(made, schema=self._schema), _ROW_GROUP)

    def _array(self, column: WrittenColumn, values: NDArray[Any]) -> Any:
        if column.words:
            indices = self._arrow.array(np.asarray(values, np.int8))
            return self._arrow.DictionaryArray.from_arrays(indices, list(column.words))
        return self._arrow.array(values)


def _conversion(words: Sequence[str]) -> dict[str, Any] | None:
    """MDF4's table from numbers to words."""
    if not words:
        return None
    numbers = {f"val_{number}": number for number in range(len(words))}
    return numbers | {f"text_{number}": word.encode() for number, word in enumerate(words)}


TABLE_WRITERS: Mapping[str, Callable[[Path, Sequence[WrittenColumn]], TableWriter]] = {
    ".csv": CsvWriter,
    ".mf4": Mdf4Writer,
    ".parquet": ParquetWriter,
}


class Column(NamedTuple):
    """A column of a file: its name, the signal it holds and its unit. factor: SI value of one unit."""

    header: str
    signal: str
    factor: float
    unit: str = ""


TIME = Column("time_s", "time", 1.0, "s")
RAIL_PRESSURE = Column("rail_pressure_MPa", "rail_pressure", MEGAPASCAL, "MPa")
NEEDLE_LIFT = Column("needle_lift_mm", "needle_lift", MILLIMETRE, "mm")
LINE_PRESSURE = Column("line_pressure_MPa", "line_pressure", MEGAPASCAL, "MPa")
INJECTION_RATE = Column("injection_rate_mm3_per_ms", "injection_rate", MM3_PER_MS, "mm3/ms")

PRINTED = (TIME, RAIL_PRESSURE, NEEDLE_LIFT, LINE_PRESSURE, INJECTION_RATE)
SI = (  # every double comes back as it was
    TIME,
    Column("rail_pressure_Pa", "rail_pressure", 1.0, "Pa"),
    Column("needle_lift_m", "needle_lift", 1.0, "m"),
    Column("line_pressure_Pa", "line_pressure", 1.0, "Pa"),
    Column("injection_rate_m3_per_s", "injection_rate", 1.0, "m3/s"),
)
_LAYOUTS = {".csv": PRINTED, ".mf4": SI, ".parquet": SI}


class PartsWriter(Protocol):
    """A recording being written part by part; a context manager that completes the file."""

    def write(self, part: Recording, /) -> None:
        """Append samples."""

    def __enter__(self) -> Self: ...

    def __exit__(self, kind: object, *raised: object) -> None: ...


class RecordingWriter:
    """The same, in our own layout of its suffix."""

    def __init__(self, path: Path, has_rate: bool) -> None:
        """Replaces an existing file."""
        suffix = path.suffix.lower()
        columns = _LAYOUTS[suffix]
        self._columns = columns if has_rate else columns[:-1]
        self._writer = TABLE_WRITERS[suffix](path, [_written(column) for column in self._columns])

    def write(self, part: Recording) -> None:
        arrays = {"time": part.time, **part.signals}
        self._writer.write([arrays[column.signal] / column.factor for column in self._columns])

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *raised: object) -> None:
        self._writer.close()


class CollectingWriter:
    """The same for a format that is written as a whole."""

    def __init__(self, path: Path, write: Callable[[Path, Recording], None]) -> None:
        self._path, self._write = path, write
        self._parts: list[Recording] = []

    def write(self, part: Recording) -> None:
        self._parts.append(part)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, *raised: object) -> None:
        if kind is None:
            self._write(self._path, joined(self._parts))


def write_whole(path: Path, recording: Recording) -> None:
    """Write a recording that is in memory."""
    with RecordingWriter(path, recording.injection_rate is not None) as writer:
        writer.write(recording)


def write_columns(path: Path, columns: Sequence[tuple[Column, NDArray[np.float64]]]) -> None:
    """Write SI arrays of one length (n,) as CSV columns in their printed units, NaN as an empty cell."""
    with CsvWriter(path, [_written(column) for column, _ in columns]) as writer:
        writer.write([values / column.factor for column, values in columns])


def _written(column: Column) -> WrittenColumn:
    return WrittenColumn(column.header, column.signal, column.unit)
