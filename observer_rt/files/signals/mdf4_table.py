"""MDF4: channels by their names; their time is that of their groups, in seconds."""

import struct
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from observer_rt.config.injector_sections import ColumnConfig, RecordingConfig
from observer_rt.files.mdf4.reader_process import mdf4_apart
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE
from observer_rt.files.signals.table import LARGEST, TIME, FileTable, Heading, TablePart, find_columns
from observer_rt.foundation.errors import UserError

_START = 64 + 24 + 6 * 8  # byte of the header block's start time


def stated_start(path: Path) -> int:
    """Start time in the header of an MDF 4 file [ns since 1970]; 0 without one, or of another file."""
    with path.open("rb") as file:
        head = file.read(_START + 8)
    if not head.startswith(b"MDF     4") or len(head) < _START + 8:
        return 0
    (start,) = struct.unpack_from("<Q", head, _START)
    return int(start)


class Channel(NamedTuple):
    """A channel as `mdf4.opening.channels` gives it. surplus: samples beyond the number that its heading states."""

    name: str
    unit: str
    group: int
    number: int
    surplus: int


class Mdf4Table(FileTable):
    """Channels by their names."""

    word = "channel"
    brings_time = True

    def __init__(self, path: Path, config: RecordingConfig, is_own: bool = False) -> None:
        super().__init__(path, config, is_own)
        if config.time is not None:
            self.notes.append(f"{path}: [recording.time] is passed over, MDF4 channels have their own time")
        channels = _channels(path)
        self.columns = {channel.name: channel.unit for channel in reversed(channels)}
        self.mapped = find_columns(path, dict(config.signals), self.columns, is_own, self.word)
        self._channels = {name: self._channel(column, channels) for name, column in self.mapped.items()}
        self.units = {name: channel.unit for name, channel in self._channels.items() if channel.unit}
        self._groups = sorted({channel.group for channel in self._channels.values()})
        self.rasters = tuple(
            tuple(name for name, of in self._channels.items() if of.group == group) for group in self._groups
        )
        for surplus in dict.fromkeys(channel.surplus for channel in self._channels.values() if channel.surplus):
            self.notes.append(
                f"{path}: its heading leaves out {surplus} samples that are in it: it may be damaged"
                if surplus > 0
                else f"{path}: its heading counts {-surplus} samples that are not in it: its end may be missing"
            )
        groups = ", ".join(map(str, self._groups))
        self.layout = f"MDF4, channels in group{'s' * (len(self._groups) > 1)} {groups}"

    @staticmethod
    def headings(path: Path) -> Sequence[Heading]:
        """Channels, with their group where several have one name; without the device that INCA puts behind it."""
        channels = _channels(path)
        names = Counter(channel.name for channel in channels)
        by_place: dict[tuple[int, int], list[Channel]] = {}
        for channel in channels:
            by_place.setdefault((channel.group, channel.number), []).append(channel)
        chosen = [min(same, key=lambda entry: (names[entry.name], len(entry.name))) for same in by_place.values()]
        return [Heading(entry.name, entry.unit, entry.group if names[entry.name] > 1 else None) for entry in chosen]

    def parts(self, raster: int) -> Iterator[TablePart]:
        indices = {name: self._channels[name].number for name in self.rasters[raster]}
        row = 0
        work = "observer_rt.files.mdf4.opening:parts"  # runs apart
        for _, columns in mdf4_apart(work, self.path, self._groups[raster], indices, SAMPLES_AT_ONCE):
            time = columns.pop(TIME)
            for name, values in columns.items():
                location = f"{self.path}, channel {self.mapped[name].column}"
                if not values.size:
                    raise UserError(location, "holds no plain numbers", "map a channel of numbers")
                beyond = np.flatnonzero(np.abs(values) > LARGEST)
                if beyond.size:
                    problem = f"sample {row + beyond[0]} is {values[beyond[0]]:g} {self.units.get(name, '')}".strip()
                    remedy = "record it again: the file is damaged, or mark such samples as invalid"
                    raise UserError(location, problem, remedy)
            row += time.size
            yield TablePart(time, columns)

    def location(self, row: int, raster: int) -> str:
        return f"{self.path}, group {self._groups[raster]}, sample {row}"

    def _channel(self, column: ColumnConfig, channels: Sequence[Channel]) -> Channel:
        candidates = [channel for channel in channels if channel.name == column.column]
        chosen = [channel for channel in candidates if column.group in (None, channel.group)]
        if len(chosen) == 1:
            return chosen[0]
        times = f"appears {len(candidates)} times: it " if len(candidates) > 1 else ""
        other = f", not in {column.group}" if column.group is not None else ""
        raise UserError(
            f"{self.path}, channel {column.column}",
            f"{times}is in the groups {', '.join(str(channel.group) for channel in candidates)}{other}",
            f"say which in [recording] of the bench file, group = {candidates[0].group}, "
            "or keep one channel of this name",
        )


def _channels(path: Path) -> list[Channel]:
    return [Channel(*channel) for channel, _ in mdf4_apart("observer_rt.files.mdf4.opening:channels", path)]
