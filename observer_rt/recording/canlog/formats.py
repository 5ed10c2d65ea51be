"""The log formats by the suffix of a file."""

from pathlib import Path

from observer_rt.foundation.errors import UserError
from observer_rt.recording.canlog.asc_reader import AscLog
from observer_rt.recording.canlog.asc_writer import AscWriter
from observer_rt.recording.canlog.blf_reader import BlfLog
from observer_rt.recording.canlog.blf_writer import BlfWriter
from observer_rt.recording.canlog.can_log import LogReader, LogWriter
from observer_rt.recording.canlog.candump import CandumpLog, CandumpWriter
from observer_rt.recording.canlog.mdf4 import Mdf4Log, Mdf4LogWriter, is_bus_log
from observer_rt.recording.canlog.trc import TrcLog, TrcWriter

MDF4 = ".mf4"  # which may hold frames or signals
LOG_READERS: dict[str, type[LogReader]] = {
    ".log": CandumpLog,
    ".blf": BlfLog,
    ".asc": AscLog,
    ".trc": TrcLog,
    MDF4: Mdf4Log,
}
LOG_WRITERS: dict[str, type[LogWriter]] = {
    ".log": CandumpWriter,
    ".blf": BlfWriter,
    ".asc": AscWriter,
    ".trc": TrcWriter,
    MDF4: Mdf4LogWriter,
}


def is_log(path: Path) -> bool:
    """Whether a file holds CAN frames, by its suffix and, for MDF4, its content.

    Raises `UserError` for an MDF4 file that is not there or damaged.
    """
    suffix = path.suffix.lower()
    return is_bus_log(path) if suffix == MDF4 else suffix in LOG_READERS


def open_log(path: Path) -> LogReader:
    """The reader of a log; nothing is read before it is iterated. Raises `UserError` for an unknown suffix."""
    suffix = path.suffix.lower()
    if suffix not in LOG_READERS:
        raise UserError(
            str(path), f"unknown kind of log '{path.suffix}'", f"known suffixes: {', '.join(LOG_READERS)}"
        )
    return LOG_READERS[suffix](path)
