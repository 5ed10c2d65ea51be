"""What a format of recordings says of itself."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from observer_rt.recording.file_format import FileFormat
from observer_rt.recording.signals.recording import Recording


@dataclass(frozen=True)
class SignalFormat(FileFormat):
    """A kind of file that holds a recording's signals."""

    reader: Callable[[Path], Recording]
    writer: Callable[[Path, Recording], None] | None = None
    """Replaces an existing file; None where the format is only read."""
