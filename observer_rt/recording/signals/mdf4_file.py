"""Signals in MDF4, ASAM's measurement file, by asammdf; to be run apart, for it trusts what stands in a file."""

import gc
import logging
import struct
import sys
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks.utils import MdfException
from asammdf.blocks.v4_blocks import FileHistory

from observer_rt.config.injector import ColumnConfig
from observer_rt.foundation.errors import UserError
from observer_rt.recording.checksum import BLANK
from observer_rt.recording.mdf4_blocks import READABLE, CountedRecords, refuse_other_files
from observer_rt.recording.signals.table import TablePart, Values, present

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
LARGEST = 1e30  # no measurement, but what can be written in any unit
NO_DATE = datetime.fromtimestamp(0, UTC)
Place = tuple[int, int]
"""Group and index of a channel."""


class FoundChannels(NamedTuple):
    """The mapped channels of a file, their places and units, units of all channels; what is odd about the file."""

    mapped: dict[str, ColumnConfig]
    places: dict[str, Place]
    units: dict[str, str]
    columns: dict[str, str]
    remarks: tuple[str, ...]


def names(path: Path) -> Iterator[list[str]]:
    """Of the channels."""
    with opened(path) as file:
        yield list(file.channels_db)


def found_and_parts(
    path: Path, wanted: Mapping[str, ColumnConfig], is_own: bool, counted: CountedRecords, at_once: int
) -> Iterator[FoundChannels | TablePart]:
    """What a file has of the channels wanted, then the parts of the first group with some of them.

    Raises `UserError` where a channel is missing or in doubt.
    """
    with opened(path) as file:
        mapped = present(path, wanted, file.channels_db, is_own, "channel")
        places = {name: _place(file, path, column) for name, column in mapped.items()}
        groups = sorted({group for group, _ in places.values()})
        for group in groups:
            refuse_outside(file, group)
        columns = {name: _unit(file, *places[0]) for name, places in file.channels_db.items()}
        units = {name: unit for name, place in places.items() if (unit := _unit(file, *place))}
        headings = [file.groups[group].channel_group.address for group in groups]
        odd = (*counted.remarks, *counted.contradictions(headings, "samples"))
        yield FoundChannels(mapped, places, units, columns, odd)
        yield from _parts(file, path, groups[0], places, counted, at_once)


def parts(
    path: Path, group: int, places: Mapping[str, Place], counted: CountedRecords, at_once: int
) -> Iterator[TablePart]:
    """The channels of one group, so many samples at once, as many as there are, whatever its heading says."""
    with opened(path) as file:
        yield from _parts(file, path, group, places, counted, at_once)


def _parts(
    file: MDF, path: Path, group: int, places: Mapping[str, Place], counted: CountedRecords, at_once: int
) -> Iterator[TablePart]:
    heading = file.groups[group].channel_group
    for first in range(0, counted.readable(heading.address, heading.cycles_nr), at_once):
        with damage_told(path):
            signals = {
                name: file.get(
                    group=group,
                    index=index,
                    ignore_invalidation_bits=True,
                    record_offset=first,
                    record_count=at_once,
                )
                for name, (wanted, index) in places.items()
                if wanted == group
            }
        time = next(iter(signals.values())).timestamps.astype(np.float64)
        yield TablePart(time, {name: _numbers(signal, path, first) for name, signal in signals.items()})


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
    """Say what wrote the file, but not when: the same content gives the same bytes. For `seal`."""
    file.start_time = NO_DATE
    history = FileHistory()
    history.time_stamp = NO_DATE
    history.comment = f"<FHcomment><TX>created; {BLANK}</TX><tool_id>observer-rt</tool_id></FHcomment>"
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


def _place(file: MDF, path: Path, column: ColumnConfig) -> Place:
    """Group and index of a channel that is there."""
    places = file.channels_db[column.name]
    chosen = [place for place in places if column.group in (None, place[0])]
    if len(chosen) != 1:
        groups = ", ".join(str(group) for group, _ in places)
        times = f"appears {len(places)} times: it " if len(places) > 1 else ""
        raise UserError(
            f"{path}, channel {column.name}",
            f"{times}is in the groups {groups}"
            + (f", not in {column.group}" if column.group is not None else ""),
            f"say which in [recording] of the bench file, group = {places[0][0]}, or keep one channel of this name",
        )
    group, index = chosen[0]
    return int(group), int(index)


def _unit(file: MDF, group: int, index: int) -> str:
    """Of a channel, or of its conversion."""
    channel = file.groups[group].channels[index]
    unit = channel.unit or (channel.conversion.unit if channel.conversion is not None else "")
    return str(unit or "").strip()


def _numbers(signal: Signal, path: Path, first: int) -> Values:
    """Samples from number `first` on; those that the channel marks as invalid become NaN."""
    place = f"{path}, channel {signal.name}"
    if signal.samples.ndim != 1 or signal.samples.dtype.kind not in "buif":
        raise UserError(place, "holds no plain numbers", "map a channel of numbers")
    values: Values = signal.samples.astype(np.float64)
    if signal.invalidation_bits is not None:
        values[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
    beyond = np.flatnonzero(np.abs(values) > LARGEST)
    if beyond.size:
        raise UserError(
            place,
            f"sample {first + beyond[0]} is {values[beyond[0]]:g} {signal.unit.strip()}",
            "record it again: the file is damaged, or mark such samples as invalid",
        )
    return values
