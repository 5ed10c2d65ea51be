"""Formats of files that hold signals."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from observer_rt.config.injector import RecordingConfig
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.table import OPTIONAL, Table


@dataclass(frozen=True)
class OwnLayout:
    """A format that is read in parts, by any mapping. table: of its files; mapping: that of our own layout."""

    table: type[Table]
    mapping: RecordingConfig

    def is_of(self, path: Path, other: RecordingConfig) -> bool:
        """Whether a file is in our own layout although another is mapped, which it is not in."""
        names = self.table.names(path)
        needed = [column for name, column in self.mapping.signals if name != OPTIONAL]
        needed += [self.mapping.time] if self.mapping.time is not None else []
        return all(column.name in names for column in needed) and any(
            column.name not in names for _, column in other.signals
        )


@dataclass(frozen=True)
class SignalFormat:
    """A kind of file that holds a recording's signals; suffixes in lower case with their dot.

    description: for help texts.
    """

    suffixes: tuple[str, ...]
    description: str
    reader: Callable[[Path], Recording] | OwnLayout
    """Reader of a file as a whole, in one layout; or the layout by which it is read in parts."""
    writer: Callable[[Path, Recording], None] | None = None
    """Replaces an existing file; None where the format is only read."""
