"""When a recording was made, and what says so."""

import struct
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path

from observer_rt.files.canlog.can_log import NANOSECONDS
from observer_rt.files.formats import is_log, open_log
from observer_rt.files.signals.stream import SignalStream

_SINCE_1970 = 1e9  # s, in 2001: time in a recording is never so late unless it counts from 1970
_MDF4_START = 64 + 24 + 6 * 8  # byte of the header block's start time [ns since 1970]


class TimeFrom(StrEnum):
    """What says a time. WRITTEN: nothing in the file, only when it was last written, which copying changes."""

    FRAMES = "frames"
    COLUMN = "column"
    HEADER = "header"
    WRITTEN = "written"


def zero_of(path: Path, source: SignalStream) -> tuple[datetime, TimeFrom]:
    """Moment of time 0 in a file, and what says it: its frames, stamps or header; else it ended when last written."""
    start, end = source.stretches[0].start, source.stretches[-1]
    if is_log(path):
        begin, by = next(iter(open_log(path))).frame.stamp_ns / NANOSECONDS - start, TimeFrom.FRAMES
    elif source.origin + start > _SINCE_1970:
        begin, by = source.origin, TimeFrom.COLUMN
    elif (stated := _mdf4_start(path)) > 0:
        begin, by = stated / NANOSECONDS, TimeFrom.HEADER
    else:
        begin = path.stat().st_mtime - end.start - end.samples / source.sample_rate
        by = TimeFrom.WRITTEN
    return datetime.fromtimestamp(begin, UTC), by


def _mdf4_start(path: Path) -> int:
    """Start time in the header of an MDF 4 file [ns since 1970]; 0 without one, or of another file."""
    with path.open("rb") as file:
        head = file.read(_MDF4_START + 8)
    if not head.startswith(b"MDF     4") or len(head) < _MDF4_START + 8:
        return 0
    (start,) = struct.unpack_from("<Q", head, _MDF4_START)
    return int(start)
