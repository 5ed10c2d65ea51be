"""Recordings as MDF4, ASAM's measurement file: one channel per signal, units read from the channel."""

import gc
import logging
import struct
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks.utils import MdfException
from asammdf.blocks.v4_blocks import FileHistory
from numpy.typing import NDArray

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.misspelt import hint
from observer_rt.foundation.units import LENGTH_UNITS, PRESSURE_UNITS
from observer_rt.recording.signals.checked import CheckedGrid, in_chunks
from observer_rt.recording.signals.recording import Chunk, Recording
from observer_rt.recording.signals.stream import SAMPLES_AT_ONCE, SignalStream
from observer_rt.recording.signals.units import RATE_UNITS

UNITS = {
    "rail_pressure": PRESSURE_UNITS,
    "needle_lift": LENGTH_UNITS,
    "line_pressure": PRESSURE_UNITS,
    "injection_rate": RATE_UNITS,
}
REQUIRED = ("rail_pressure", "needle_lift", "line_pressure")
MAGIC = b"MDF"
READABLE = "give a complete MDF 4 measurement"
DAMAGE = (  # the ways in which asammdf fails on a damaged file
    MdfException,
    struct.error,
    OSError,
    MemoryError,
    ArithmeticError,
    ValueError,
    LookupError,
    EOFError,
    TypeError,
    AttributeError,
)
logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # its complaints come as errors, too
NO_DATE = datetime.fromtimestamp(0, UTC)


class Mdf4Signals(SignalStream):
    """A recording by the names of its channels; those beyond the recording's own are ignored.

    The samples that a channel marks as invalid become NaN. Raises `UserError` for a file that is not MDF, a
    missing channel, an unknown unit and channels on different time stamps.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._file = path
        checked = CheckedGrid(self, lambda row: f"{path}, sample {row}")
        for arrays in self._parts():
            self.has_rate = "injection_rate" in arrays
            checked.take(arrays)
        checked.end()

    def chunks(self) -> Iterator[Chunk]:
        """Read anew."""
        return in_chunks(self, self._parts())

    def _parts(self) -> Iterator[dict[str, NDArray[np.float64]]]:
        path = self._file
        with opened(path) as file:
            places = _places(file, path)
            samples = max(file.groups[group].channel_group.cycles_nr for group, _ in places.values())
            for first in range(0, samples, SAMPLES_AT_ONCE):
                with damage_told(path):
                    signals = {name: part_of(file, *place, first) for name, place in places.items()}
                time = signals["rail_pressure"].timestamps.astype(np.float64)
                for name, signal in signals.items():
                    if not np.array_equal(signal.timestamps, time):
                        raise UserError(
                            f"{path}, channel {name}",
                            "its time stamps differ from those of rail_pressure",
                            "record the channels in one group, resample them on one time grid, or describe them in "
                            "[recording] of a bench file, which resamples",
                        )
                yield {"time": time, **{name: _to_si(signal, path) for name, signal in signals.items()}}


def read_mdf4(path: Path) -> Recording:
    """Read a recording, as `Mdf4Signals`."""
    return Mdf4Signals(path).collected()


def mdf4_names(path: Path) -> list[str]:
    """Of the channels."""
    with opened(path) as file:
        return list(file.channels_db)


@contextmanager
def opened(path: Path) -> Iterator[MDF]:
    """A file to read; the many ways in which asammdf fails on a damaged one become a `UserError`."""
    with path.open("rb") as handle:
        if handle.read(len(MAGIC)) != MAGIC:
            raise UserError(str(path), "not an MDF file", READABLE)
        handle.seek(0)
        with damage_told(path), MDF(handle) as file:
            yield file


@contextmanager
def damage_told(path: Path) -> Iterator[None]:
    """Turn asammdf's own errors into `UserError`."""
    try:
        yield
    except DAMAGE as error:
        discard(error)
        raise UserError(str(path), f"a damaged MDF file: {error}", READABLE) from None


def add_history(file: MDF) -> None:
    """Say what wrote the file, but not when: the same content gives the same bytes."""
    file.start_time = NO_DATE
    history = FileHistory()
    history.time_stamp = NO_DATE
    history.comment = "<FHcomment><TX>created</TX><tool_id>observer-rt</tool_id></FHcomment>"
    file.file_history.append(history)


def discard(error: Exception) -> None:
    """Drop the half-read file: asammdf's destructor fails on it, which would print a traceback later on."""
    hook = sys.unraisablehook
    sys.unraisablehook = lambda _: None
    try:
        traceback.clear_frames(error.__traceback__)
        gc.collect()
    finally:
        sys.unraisablehook = hook


def refuse_outside(file: MDF, group: int) -> None:
    """Raise `ValueError` for a field that reaches beyond its record: asammdf would read there all the same."""
    record = file.groups[group].channel_group.samples_byte_nr
    for channel in file.groups[group].channels:
        end = channel.byte_offset + (channel.bit_offset + channel.bit_count + 7) // 8
        if end > record:
            raise ValueError(f"{channel.name} reaches to byte {end} of records of {record}")


def part_of(file: MDF, group: int, index: int, first: int, count: int = SAMPLES_AT_ONCE) -> Signal:
    """At most `count` samples of a channel from one on."""
    return file.get(
        group=group,
        index=index,
        ignore_invalidation_bits=True,
        record_offset=first,
        record_count=count,
    )


def _places(file: MDF, path: Path) -> dict[str, tuple[int, int]]:
    """Group and index of the channels by the signals they hold."""
    found = {}
    for name in UNITS:
        places = file.channels_db.get(name, ())
        if len(places) > 1:
            raise UserError(
                f"{path}, channel {name}", f"appears {len(places)} times", "keep one channel of this name"
            )
        if places:
            refuse_outside(file, places[0][0])
            found[name] = places[0]
        elif name in REQUIRED:
            raise UserError(
                str(path),
                f"channel '{name}' is missing{hint(name, file.channels_db)}",
                f"name the channels {', '.join(UNITS)} (the last optional), or say in [recording] of a bench file "
                "which is which",
            )
    return found


def _to_si(signal: Signal, path: Path) -> NDArray[np.float64]:
    units = UNITS[signal.name]
    unit = signal.unit.strip()
    if unit not in units:
        raise UserError(
            f"{path}, channel {signal.name}",
            f"unit '{unit}' is not known" if unit else "has no unit",
            f"known units: {', '.join(units)}",
        )
    values: NDArray[np.float64] = signal.samples.astype(np.float64) * units[unit]
    if signal.invalidation_bits is not None:
        values[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
    return values
