"""Formats of files that hold signals."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from observer_rt.config.injector import RecordingConfig
from observer_rt.files.signals.recording import OPTIONAL, Recording
from observer_rt.files.signals.table import FileTable


@dataclass(frozen=True)
class OwnLayout:
    """A format that is read in parts, by any mapping. table: of its files; mapping: that of our own layout."""

    table: type[FileTable]
    mapping: RecordingConfig

    def is_of(self, path: Path, other: RecordingConfig | None) -> bool:
        """Whether a file is in our own layout, and not in another one."""
        names = self.table.names(path)
        needed = [column.name for name, column in self.mapping.signals if name not in OPTIONAL]
        needed += [self.mapping.time.name] if self.mapping.time is not None else []
        is_in_another = other is not None and all(column.name in names for _, column in other.signals)
        return all(name in names for name in needed) and not is_in_another


@dataclass(frozen=True)
class SignalFormat:
    """A kind of file that holds a recording's signals; suffixes in lower case with their dot.

    description: for help texts.
    """

    suffixes: tuple[str, ...]
    description: str
    reader: OwnLayout
    writer: Callable[[Path, Recording], None] | None = None
    """Replaces an existing file; None where the format is only read."""
