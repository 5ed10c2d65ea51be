"""MDF4, ASAM's measurement file, which holds frames or signals. asammdf, slow to import, only where it is needed."""

from pathlib import Path

from observer_rt.recording.canlog.can_log import LogReader, LogWriter
from observer_rt.recording.canlog.log_format import LogFormat
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.signal_format import SignalFormat


def _log_reader(path: Path) -> LogReader:
    from observer_rt.recording.canlog.mdf4 import Mdf4Log

    return Mdf4Log(path)


def _log_writer(path: Path, start_ns: int) -> LogWriter:
    from observer_rt.recording.canlog.mdf4 import Mdf4LogWriter

    return Mdf4LogWriter(path, start_ns)


def _holds_frames(path: Path) -> bool:
    from observer_rt.recording.canlog.mdf4 import is_bus_log

    return is_bus_log(path)


def _read(path: Path) -> Recording:
    from observer_rt.recording.signals.mdf4_file import read_mdf4

    return read_mdf4(path)


def _write(path: Path, recording: Recording) -> None:
    from observer_rt.recording.signals.mdf4_file import write_mdf4

    write_mdf4(path, recording)


MDF4_LOG = LogFormat(
    (".mf4",), "ASAM MDF4, bus logging", _log_reader, _log_writer, holds_frames=_holds_frames
)
MDF4_SIGNALS = SignalFormat((".mf4",), "ASAM MDF4, one channel a signal, with its unit", _read, _write)
