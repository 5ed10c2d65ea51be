"""CAN frames in MDF4 files: read by a process apart (`bus_frames`)."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from observer_rt.bus.can_frame import FD_LENGTHS
from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import LogFormat, LogFrame, LogReader
from observer_rt.files.mdf4.reader_process import crash_told, mdf4_apart
from observer_rt.foundation.sandbox import WorkerError, checked

FRAMES = "observer_rt.files.mdf4.bus_frames"  # what touches the file runs apart
DATA = "CAN_DataFrame"
MAX_LENGTH = FD_LENGTHS[-1]
CHANNEL_NAME = 16  # characters
RECORD = np.dtype(
    [
        ("id", np.uint32),
        ("stamp", np.int64),  # ns since 1970
        ("is_extended", np.bool_),
        ("is_fd", np.bool_),
        ("bit_rate_switch", np.bool_),
        ("error_state", np.bool_),
        ("channel", f"U{CHANNEL_NAME}"),
        ("is_sent", np.bool_),
        ("length", np.uint8),
        ("data", np.uint8, MAX_LENGTH),
    ]
)
"""A frame as it comes from the process apart."""
_FLAG = TypeAdapter(bool)
_TOTALS = TypeAdapter(tuple[int, int, int, int, list[str]])


def is_bus_log(path: Path) -> bool:
    """Whether an MDF4 file is a log of a bus. Raises `UserError` for a file that is damaged or none of MDF."""
    with crash_told(path):
        return checked(_FLAG, next(mdf4_apart(FRAMES, "is_log", path), None))


class Mdf4Log(LogReader):
    """Reader; channels are named by their number. Frames of several groups are put in order of time."""

    unit = "frame"

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        parts = mdf4_apart(FRAMES, "frames", self.path)
        with crash_told(self.path):
            totals = checked(_TOTALS, next(parts, None))
        self._size, self.error_frames, self.remote_frames, self.other_entries, remarks = totals
        self.remarks += remarks
        if not self._size:
            self.remarks.append(
                "it is a CAN log without a data frame: nothing was recorded, or it is damaged"
            )
        for part in parts:
            with crash_told(self.path):
                records = _records_of(part)
            data = records["data"].tobytes()
            for number, (*fields, channel, is_sent, length) in zip(
                range(0, len(data), MAX_LENGTH), records[list(RECORD.fields or ())[:-1]].tolist(), strict=True
            ):
                self._position += 1
                frame = Frame(fields[0], data[number : number + length], *fields[1:])
                yield self._position, LogFrame(frame, channel, is_sent)


def _records_of(part: Any) -> NDArray[np.void]:
    """Frames that the process apart sent. Raises `WorkerError` for anything else."""
    if not (isinstance(part, np.ndarray) and part.dtype == RECORD and part.ndim == 1):
        raise WorkerError("its reader gave something else than frames")
    if np.any(part["length"] > MAX_LENGTH):
        raise WorkerError(f"its reader gave frames of more than {MAX_LENGTH} bytes")
    return part


MDF4_LOG = LogFormat(".mf4", Mdf4Log, recognises=is_bus_log)
