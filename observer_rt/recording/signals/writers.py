"""Recordings written part by part, in our own layouts."""

from collections.abc import Callable
from pathlib import Path
from typing import Protocol, Self

from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE, MM3_PER_MS
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.stream import joined
from observer_rt.recording.signals.table_writers import TABLE_WRITERS, WrittenColumn

_PRINTED = {
    "time": (WrittenColumn("time_s", "time", "s"), 1.0),
    "rail_pressure": (WrittenColumn("rail_pressure_MPa", "rail_pressure"), MEGAPASCAL),
    "needle_lift": (WrittenColumn("needle_lift_mm", "needle_lift"), MILLIMETRE),
    "line_pressure": (WrittenColumn("line_pressure_MPa", "line_pressure"), MEGAPASCAL),
    "injection_rate": (WrittenColumn("injection_rate_mm3_per_ms", "injection_rate"), MM3_PER_MS),
}
_SI = {  # every double comes back as it was
    "time": (WrittenColumn("time_s", "time", "s"), 1.0),
    "rail_pressure": (WrittenColumn("rail_pressure_Pa", "rail_pressure", "Pa"), 1.0),
    "needle_lift": (WrittenColumn("needle_lift_m", "needle_lift", "m"), 1.0),
    "line_pressure": (WrittenColumn("line_pressure_Pa", "line_pressure", "Pa"), 1.0),
    "injection_rate": (WrittenColumn("injection_rate_m3_per_s", "injection_rate", "m3/s"), 1.0),
}
LAYOUTS = {".csv": _PRINTED, ".mf4": _SI, ".parquet": _SI}


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
        layout = LAYOUTS[path.suffix.lower()]
        self._columns = {
            name: entry for name, entry in layout.items() if has_rate or name != "injection_rate"
        }
        self._writer = TABLE_WRITERS[path.suffix.lower()](
            path, [column for column, _ in self._columns.values()]
        )

    def write(self, part: Recording) -> None:
        arrays = {"time": part.time, **part.signals}
        self._writer.write([arrays[name] / factor for name, (_, factor) in self._columns.items()])

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
