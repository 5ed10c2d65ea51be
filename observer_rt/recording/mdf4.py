"""MDF4, ASAM's measurement file, as a log.

asammdf reads it in a process of its own; here it is imported, which is slow, only to write.
"""

from pathlib import Path

from observer_rt.recording.canlog.can_log import LogWriter
from observer_rt.recording.canlog.log_format import LogFormat
from observer_rt.recording.canlog.mdf4.reader import Mdf4Log, is_bus_log


def _log_writer(path: Path, start_ns: int) -> LogWriter:
    from observer_rt.recording.canlog.mdf4.writer import Mdf4LogWriter

    return Mdf4LogWriter(path, start_ns)


MDF4_LOG = LogFormat((".mf4",), "ASAM MDF4, bus logging", Mdf4Log, _log_writer, recognises=is_bus_log)
