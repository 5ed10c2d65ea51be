"""What a format of recordings says of itself."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from observer_rt.recording.signals.recording import Recording


@dataclass(frozen=True)
class SignalFormat:
    """A kind of file that holds a recording's signals."""

    suffixes: tuple[str, ...]
    """Of its files, in lower case with their dot."""
    description: str
    reader: Callable[[Path], Recording]
    writer: Callable[[Path, Recording], None] | None = None
    """Replaces an existing file; None where the format is only read."""
