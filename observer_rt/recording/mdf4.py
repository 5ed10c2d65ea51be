"""MDF4, ASAM's measurement file, as a log. asammdf, slow to import, only where it is needed."""

from pathlib import Path

from observer_rt.recording.canlog.can_log import LogReader, LogWriter
from observer_rt.recording.canlog.log_format import LogFormat


def _log_reader(path: Path) -> LogReader:
    from observer_rt.recording.canlog.mdf4 import Mdf4Log

    return Mdf4Log(path)


def _log_writer(path: Path, start_ns: int) -> LogWriter:
    from observer_rt.recording.canlog.mdf4 import Mdf4LogWriter

    return Mdf4LogWriter(path, start_ns)


def _holds_frames(path: Path) -> bool:
    from observer_rt.recording.canlog.mdf4 import is_bus_log

    return is_bus_log(path)


MDF4_LOG = LogFormat(
    (".mf4",), "ASAM MDF4, bus logging", _log_reader, _log_writer, holds_frames=_holds_frames
)
