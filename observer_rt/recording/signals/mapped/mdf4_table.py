"""MDF4 with channels of any names, in any groups: each group has a time axis of its own."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from asammdf import MDF, Signal

from observer_rt.config.recording import ColumnConfig, RecordingConfig
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.misspelt import hint
from observer_rt.recording.signals.mapped.table import Part, Table, Values
from observer_rt.recording.signals.mdf4_file import damage_told, opened, part_of, refuse_outside
from observer_rt.recording.signals.stream import SAMPLES_AT_ONCE


class Mdf4Table(Table):
    """Channels by their names; time is that of their groups, in seconds."""

    brings_time = True

    def __init__(self, path: Path, config: RecordingConfig) -> None:
        super().__init__(path, config)
        if config.time is not None:
            self.notes.append(f"{path}: [recording.time] is passed over, MDF4 channels have their own time")
        with opened(path) as file:
            self._places = {name: _place(file, path, column) for name, column in config.signals}
            for group, _ in self._places.values():
                refuse_outside(file, group)
            self.columns = {name: _unit(file, *places[0]) for name, places in file.channels_db.items()}
            units = {name: _unit(file, *place) for name, place in self._places.items()}
        self._groups = sorted({group for group, _ in self._places.values()})
        self.rasters = tuple(
            tuple(name for name, (group, _) in self._places.items() if group == wanted)
            for wanted in self._groups
        )
        self.units = {name: unit for name, unit in units.items() if unit}
        groups = ", ".join(map(str, self._groups))
        self.layout = f"MDF4, channels in group{'s' * (len(self._groups) > 1)} {groups}"

    def parts(self, raster: int) -> Iterator[Part]:
        """Of a group."""
        group = self._groups[raster]
        with opened(self.path) as file:
            samples = file.groups[group].channel_group.cycles_nr
            for first in range(0, samples, SAMPLES_AT_ONCE):
                time: Values | None = None
                signals = {}
                for name in self.rasters[raster]:
                    with damage_told(self.path):
                        signal = part_of(file, *self._places[name], first, SAMPLES_AT_ONCE)
                    signals[name] = self._numbers(signal)
                    time = signal.timestamps.astype(np.float64)
                if time is not None and time.size:
                    yield Part(time, signals)

    def place(self, row: int, raster: int) -> str:
        """By its number in the group."""
        return f"{self.path}, group {self._groups[raster]}, sample {row}"

    def _numbers(self, signal: Signal) -> Values:
        if signal.samples.ndim != 1 or signal.samples.dtype.kind not in "buif":
            raise UserError(
                f"{self.path}, channel {signal.name}", "holds no plain numbers", "map a channel of numbers"
            )
        values: Values = signal.samples.astype(np.float64)
        if signal.invalidation_bits is not None:
            values[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
        return values


def _place(file: MDF, path: Path, column: ColumnConfig) -> tuple[int, int]:
    """Group and index of a channel."""
    places = file.channels_db.get(column.column, ())
    if not places:
        names = ", ".join(list(file.channels_db)[:40])
        raise UserError(
            str(path),
            f"channel '{column.column}' is missing{hint(column.column, file.channels_db)}",
            f"name the channels in [recording] of the bench file as the file does: it has {names}",
        )
    chosen = [place for place in places if column.group in (None, place[0])]
    if len(chosen) != 1:
        groups = ", ".join(str(group) for group, _ in places)
        raise UserError(
            f"{path}, channel {column.column}",
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
