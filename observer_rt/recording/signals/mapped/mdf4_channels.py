"""Mapped channels of MDF4 files, by asammdf; to be run apart."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from asammdf import MDF, Signal

from observer_rt.config.recording import ColumnConfig, RecordingConfig
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.misspelt import hint
from observer_rt.recording.mdf4_blocks import Counted
from observer_rt.recording.signals.mapped.table import Part, Values
from observer_rt.recording.signals.mdf4_file import (
    damage_told,
    opened,
    part_of,
    readable,
    refuse_outside,
    remarks,
)

Place = tuple[int, int]
"""Group and index of a channel."""


class Found(NamedTuple):
    """Places and units of the mapped channels, units of all channels of the file; by name; what is odd about it."""

    places: dict[str, Place]
    units: dict[str, str]
    columns: dict[str, str]
    remarks: tuple[str, ...]


def found(path: Path, config: RecordingConfig, counted: Counted) -> Iterator[Found]:
    """One: what a file has of the channels named. Raises `UserError` where one is missing or in doubt."""
    with opened(path) as file:
        places = {name: _place(file, path, column) for name, column in config.signals}
        for group, _ in places.values():
            refuse_outside(file, group)
        columns = {name: _unit(file, *places[0]) for name, places in file.channels_db.items()}
        units = {name: _unit(file, *place) for name, place in places.items()}
        odd = remarks(file, {group for group, _ in places.values()}, counted)
        yield Found(places, {name: unit for name, unit in units.items() if unit}, columns, odd)


def parts(
    path: Path, group: int, places: Mapping[str, Place], counted: Counted, at_once: int
) -> Iterator[Part]:
    """Of channels of one group, so many samples at once."""
    with opened(path) as file:
        for first in range(0, readable(file, group, counted), at_once):
            time: Values | None = None
            signals = {}
            for name, place in places.items():
                with damage_told(path):
                    signal = part_of(file, *place, first, at_once)
                signals[name] = _numbers(signal, path)
                time = signal.timestamps.astype(np.float64)
            if time is not None:
                yield Part(time, signals)


def _numbers(signal: Signal, path: Path) -> Values:
    if signal.samples.ndim != 1 or signal.samples.dtype.kind not in "buif":
        raise UserError(
            f"{path}, channel {signal.name}", "holds no plain numbers", "map a channel of numbers"
        )
    values: Values = signal.samples.astype(np.float64)
    if signal.invalidation_bits is not None:
        values[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
    return values


def _place(file: MDF, path: Path, column: ColumnConfig) -> Place:
    """Group and index of a channel."""
    places = file.channels_db.get(column.name, ())
    if not places:
        names = ", ".join(list(file.channels_db)[:40])
        raise UserError(
            str(path),
            f"channel '{column.name}' is missing{hint(column.name, file.channels_db)}",
            f"name the channels in [recording] of the bench file as the file does: it has {names}",
        )
    chosen = [place for place in places if column.group in (None, place[0])]
    if len(chosen) != 1:
        groups = ", ".join(str(group) for group, _ in places)
        raise UserError(
            f"{path}, channel {column.name}",
            f"is in the groups {groups}" + (f", not in {column.group}" if column.group is not None else ""),
            f"say which in [recording] of the bench file: group = {places[0][0]}",
        )
    group, index = chosen[0]
    return int(group), int(index)


def _unit(file: MDF, group: int, index: int) -> str:
    """Of a channel, or of its conversion."""
    channel = file.groups[group].channels[index]
    unit = channel.unit or (channel.conversion.unit if channel.conversion is not None else "")
    return str(unit or "").strip()
