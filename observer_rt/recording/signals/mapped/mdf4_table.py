"""MDF4 with channels of any names, in any groups: each group has a time axis of its own."""

from collections.abc import Collection, Iterator
from pathlib import Path

from observer_rt.config.recording import RecordingConfig
from observer_rt.recording.mdf4_apart import mdf4_apart
from observer_rt.recording.mdf4_records import count_records
from observer_rt.recording.signals.mapped.table import Table, TablePart
from observer_rt.recording.signals.stream import SAMPLES_AT_ONCE

FILE = "observer_rt.recording.signals.mdf4_file"  # what touches the file runs apart


class Mdf4Table(Table):
    """Channels by their names; time is that of their groups, in seconds."""

    word = "channel"
    brings_time = True

    def __init__(self, path: Path, config: RecordingConfig, is_own: bool = False) -> None:
        super().__init__(path, config, is_own)
        if config.time is not None:
            self.notes.append(f"{path}: [recording.time] is passed over, MDF4 channels have their own time")
        self._counted = count_records(path)
        wanted = dict(config.signals)
        begun = mdf4_apart(FILE, "found_and_parts", path, wanted, is_own, self._counted, SAMPLES_AT_ONCE)
        found = next(begun)
        self._begun: Iterator[TablePart] | None = begun
        self.notes += [f"{path}: {remark}" for remark in found.remarks]
        self.mapped, self._places = found.mapped, found.places
        self.units, self.columns = found.units, found.columns
        self._groups = sorted({group for group, _ in self._places.values()})
        self.rasters = tuple(
            tuple(name for name, (group, _) in self._places.items() if group == wanted)
            for wanted in self._groups
        )
        groups = ", ".join(map(str, self._groups))
        self.layout = f"MDF4, channels in group{'s' * (len(self._groups) > 1)} {groups}"

    @staticmethod
    def names(path: Path) -> Collection[str]:
        """Of the channels."""
        (names,) = mdf4_apart(FILE, "names", path)
        return list(names)

    def parts(self, raster: int) -> Iterator[TablePart]:
        """Of a group; those of the first one are already on their way when they are asked for first."""
        begun = self._begun
        if raster == 0 and begun is not None:
            self._begun = None
            return begun
        group = self._groups[raster]
        return mdf4_apart(FILE, "parts", self.path, group, self._places, self._counted, SAMPLES_AT_ONCE)

    def place(self, row: int, raster: int) -> str:
        """By its number in the group."""
        return f"{self.path}, group {self._groups[raster]}, sample {row}"
