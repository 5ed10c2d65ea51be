"""MDF4 with channels of any names, in any groups: each group has a time axis of its own."""

from collections.abc import Iterator
from pathlib import Path

from observer_rt.config.recording import RecordingConfig
from observer_rt.recording.mdf4_apart import mdf4_apart
from observer_rt.recording.mdf4_records import count_records
from observer_rt.recording.signals.mapped.table import Part, Table
from observer_rt.recording.signals.stream import SAMPLES_AT_ONCE

CHANNELS = "observer_rt.recording.signals.mapped.mdf4_channels"


class Mdf4Table(Table):
    """Channels by their names; time is that of their groups, in seconds."""

    brings_time = True

    def __init__(self, path: Path, config: RecordingConfig) -> None:
        super().__init__(path, config)
        if config.time is not None:
            self.notes.append(f"{path}: [recording.time] is passed over, MDF4 channels have their own time")
        self._counted = count_records(path)
        (found,) = mdf4_apart(CHANNELS, "found", path, config, self._counted)
        self.notes += [f"{path}: {remark}" for remark in found.remarks]
        self._places, self.units, self.columns = found.places, found.units, found.columns
        self._groups = sorted({group for group, _ in self._places.values()})
        self.rasters = tuple(
            tuple(name for name, (group, _) in self._places.items() if group == wanted)
            for wanted in self._groups
        )
        groups = ", ".join(map(str, self._groups))
        self.layout = f"MDF4, channels in group{'s' * (len(self._groups) > 1)} {groups}"

    def parts(self, raster: int) -> Iterator[Part]:
        """Of a group."""
        places = {name: self._places[name] for name in self.rasters[raster]}
        group = self._groups[raster]
        return mdf4_apart(CHANNELS, "parts", self.path, group, places, self._counted, SAMPLES_AT_ONCE)

    def place(self, row: int, raster: int) -> str:
        """By its number in the group."""
        return f"{self.path}, group {self._groups[raster]}, sample {row}"
