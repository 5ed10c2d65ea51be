"""MDF4, ASAM's measurement file, which holds frames or signals.

asammdf reads it in a process of its own; here it is imported, which is slow, only to write.
"""

from pathlib import Path

from observer_rt.recording.canlog.can_log import LogWriter
from observer_rt.recording.canlog.log_format import LogFormat
from observer_rt.recording.canlog.mdf4_reader import Mdf4Log, is_bus_log, mdf4_apart
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.signal_format import SignalFormat

SIGNALS = "observer_rt.recording.signals.mdf4_file"


def _log_writer(path: Path, start_ns: int) -> LogWriter:
    from observer_rt.recording.canlog.mdf4_writer import Mdf4LogWriter

    return Mdf4LogWriter(path, start_ns)


def _read(path: Path) -> Recording:
    (recording,) = mdf4_apart(SIGNALS, "recordings", path)
    assert isinstance(recording, Recording)
    return recording


def _write(path: Path, recording: Recording) -> None:
    from observer_rt.recording.signals.mdf4_file import write_mdf4

    write_mdf4(path, recording)


MDF4_LOG = LogFormat((".mf4",), "ASAM MDF4, bus logging", Mdf4Log, _log_writer, recognises=is_bus_log)
MDF4_SIGNALS = SignalFormat((".mf4",), "ASAM MDF4, one channel a signal, with its unit", _read, _write)
