"""Channels of an MDF4 file as signals, by asammdf; to be run apart, for it trusts what stands in a file."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF, Signal

from observer_rt.config.injector import ColumnConfig
from observer_rt.files.mdf4.blocks import CountedRecords
from observer_rt.files.mdf4.opening import damage_told, opened, refuse_outside
from observer_rt.files.signals.table import LARGEST, FoundChannels, Place, Values, present
from observer_rt.foundation.errors import UserError

Part = tuple[Values, dict[str, Values]]
"""Fields of a `TablePart`."""


def names(path: Path) -> Iterator[list[str]]:
    """Names of the channels."""
    with opened(path) as file:
        yield list(file.channels_db)


def preview(path: Path, most: int) -> Iterator[tuple[str, Values, str, Values, int]]:
    """Fields of a `Column` for each channel of numbers but for those of time, up to their first `most` samples."""
    with opened(path) as file:
        for name, places in file.channels_db.items():
            for group, index in places:
                refuse_outside(file, group)
                if index == file.masters_db.get(group):
                    continue
                with damage_told(path):
                    signal = file.get(group=group, index=index, record_count=most)
                if signal.samples.ndim == 1 and signal.samples.dtype.kind in "iuf":
                    time = signal.timestamps.astype(np.float64)
                    values = signal.samples.astype(np.float64)
                    yield name, values, _unit(file, group, index), time, int(group)


def found_and_parts(
    path: Path, wanted: Mapping[str, Any], is_own: bool, counted: str, at_once: int
) -> Iterator[FoundChannels | Part]:
    """Channels of a file that are wanted, then the parts of the first group with some of them.

    wanted: the content of a `ColumnConfig` by signal; counted: JSON of `CountedRecords`.

    Raises `UserError` where a channel is missing or ambiguous.
    """
    with opened(path) as file:
        records = CountedRecords.of_json(counted)
        columns = {name: ColumnConfig.model_validate(column) for name, column in wanted.items()}
        mapped = present(path, columns, file.channels_db, is_own, "channel")
        places = {name: _place(file, path, column) for name, column in mapped.items()}
        groups = sorted({group for group, _ in places.values()})
        for group in groups:
            refuse_outside(file, group)
        of_all = {name: _unit(file, *places[0]) for name, places in file.channels_db.items()}
        units = {name: unit for name, place in places.items() if (unit := _unit(file, *place))}
        headings = [file.groups[group].channel_group.address for group in groups]
        odd = (*records.remarks, *records.contradictions(headings, "samples"))
        yield FoundChannels(places, units, of_all, odd)
        yield from _parts(file, path, groups[0], places, records, at_once)


def parts(path: Path, group: int, places: Mapping[str, Place], counted: str, at_once: int) -> Iterator[Part]:
    """The channels of one group, so many samples at once, as many as there are, whatever its heading says."""
    with opened(path) as file:
        yield from _parts(file, path, group, places, CountedRecords.of_json(counted), at_once)


def _parts(
    file: MDF, path: Path, group: int, places: Mapping[str, Place], counted: CountedRecords, at_once: int
) -> Iterator[Part]:
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
        yield time, {name: _numbers(signal, path, first) for name, signal in signals.items()}


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
    """Unit of a channel, or of its conversion."""
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
