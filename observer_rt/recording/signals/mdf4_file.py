"""Signals in MDF4, ASAM's measurement file, by asammdf: one channel per signal, units read from the channel."""

import gc
import logging
import struct
import sys
import traceback
from collections.abc import Iterable, Iterator
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
from observer_rt.recording.mdf4_apart import READABLE
from observer_rt.recording.mdf4_blocks import Counted, refuse_other_files
from observer_rt.recording.signals.units import RATE_UNITS

UNITS = {
    "rail_pressure": PRESSURE_UNITS,
    "needle_lift": LENGTH_UNITS,
    "line_pressure": PRESSURE_UNITS,
    "injection_rate": RATE_UNITS,
}
REQUIRED = ("rail_pressure", "needle_lift", "line_pressure")
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
LARGEST = 1e30  # in SI: no measurement, but what can be written in any unit
NO_DATE = datetime.fromtimestamp(0, UTC)


def parts(
    path: Path, counted: Counted, at_once: int
) -> Iterator[tuple[str, ...] | dict[str, NDArray[np.float64]]]:
    """What is odd about the number of samples, then time [s] and signals in SI units by the names of their channels.

    So many samples at once, as many as there are in the file, whatever its heading says; to be run apart.
    Channels beyond the recording's own are ignored. The samples that a channel marks as invalid become NaN. Raises
    `UserError` for a file that is not MDF, a missing channel, an unknown unit and channels on different time stamps.
    """
    with opened(path) as file:
        places = _places(file, path)
        groups = {group for group, _ in places.values()}
        samples = max(readable(file, group, counted) for group in groups)
        yield remarks(file, groups, counted)
        for first in range(0, samples, at_once):
            with damage_told(path):
                signals = {name: part_of(file, *place, first, at_once) for name, place in places.items()}
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


def names(path: Path) -> Iterator[list[str]]:
    """Of the channels, to be run apart."""
    with opened(path) as file:
        yield list(file.channels_db)


@contextmanager
def opened(path: Path) -> Iterator[MDF]:
    """A file to read; the many ways in which asammdf fails on a damaged one become a `UserError`.

    One that is not finalised asammdf finalises in a temporary copy.
    """
    refuse_other_files(path)
    with damage_told(path), MDF(path) as file:
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


def part_of(file: MDF, group: int, index: int, first: int, count: int) -> Signal:
    """At most `count` samples of a channel from one on."""
    return file.get(
        group=group,
        index=index,
        ignore_invalidation_bits=True,
        record_offset=first,
        record_count=count,
    )


def readable(file: MDF, group: int, counted: Counted) -> int:
    """How many samples of a group can be read."""
    heading = file.groups[group].channel_group
    return counted.readable(heading.address, heading.cycles_nr)


def remarks(file: MDF, groups: Iterable[int], counted: Counted) -> tuple[str, ...]:
    """What is odd about the number of samples."""
    places = [file.groups[group].channel_group.address for group in groups]
    return (*counted.remarks, *counted.contradictions(places, "samples"))


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
    beyond = np.flatnonzero(np.abs(values) > LARGEST)
    if beyond.size:
        raise UserError(
            f"{path}, channel {signal.name}",
            f"sample {beyond[0]} is {signal.samples[beyond[0]]:g} {unit}",
            "record it again: the file is damaged, or mark such samples as invalid",
        )
    return values
