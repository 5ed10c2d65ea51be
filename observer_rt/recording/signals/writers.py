"""Our own layouts of CSV, MDF4 and Parquet, and recordings written in them part by part."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE, MM3_PER_MS
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.stream import joined
from observer_rt.recording.signals.table_writers import TABLE_WRITERS, CsvWriter, WrittenColumn


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
