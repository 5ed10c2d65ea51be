"""Formats of files that hold signals."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path

from observer_rt.config.recording import RecordingConfig
from observer_rt.recording.file_format import FileFormat
from observer_rt.recording.signals.mapped.table import Table
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.stream import SignalStream


@dataclass(frozen=True)
class Layouts:
    """A format that is read in parts, in our own layout and in any other.

    own: names that a file in our own layout has; names: all of a file; stream: reads our own layout, looking through
    it before; table: another one by its mapping; in_one_go: our own layout, as of `GridSignals`, if that can be.
    """

    own: frozenset[str]
    names: Callable[[Path], Collection[str]]
    stream: Callable[[Path], SignalStream]
    table: Callable[[Path, RecordingConfig], Table]
    in_one_go: Callable[[Path], SignalStream] | None = None

    def is_own(self, path: Path, config: RecordingConfig) -> bool:
        """Whether a file is in our own layout although another is mapped, which it is not in."""
        names = self.names(path)
        return self.own <= set(names) and any(column.name not in names for _, column in config.signals)


@dataclass(frozen=True)
class SignalFormat(FileFormat):
    """A kind of file that holds a recording's signals."""

    reader: Callable[[Path], Recording]
    writer: Callable[[Path, Recording], None] | None = None
    """Replaces an existing file; None where the format is only read."""
    layouts: Layouts | None = None
    """None where files are read as a whole, and in one layout."""
