"""What a format of CAN logs says of itself."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from observer_rt.recording.canlog.can_log import LogReader, LogRecorder, LogWriter
from observer_rt.recording.file_format import FileFormat


@dataclass(frozen=True)
class LogFormat(FileFormat):
    """A kind of file that holds CAN frames; callables take the path, those that write the time of the start [ns]."""

    reader: Callable[[Path], LogReader]
    writer: Callable[[Path, int], LogWriter] | None = None
    """None where it is only read."""
    recorder: Callable[[Path, int], LogRecorder] | None = None
    """None where what was written so far could not be read after a loss of power."""
    keeps_fd: bool = True
    """Whether CAN FD frames can be written."""
    stamp_step: int = 1
    """ns to which stamps are written."""
    is_text: bool = False
    """Whether its reader is a `TextLogReader`, which also reads what gzip packed."""
    recognises: Callable[[Path], bool] | None = None
    """Whether a file is of this format, where those of another have the same suffix; None: any is."""
