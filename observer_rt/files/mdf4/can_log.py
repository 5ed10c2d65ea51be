"""CAN frames in MDF4 files: read by a process apart (`bus_frames`)."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from observer_rt.bus.can_frame import FD_LENGTHS
from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import LogFormat, LogFrame, LogReader
from observer_rt.files.mdf4.reader_process import mdf4_apart

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


def is_bus_log(path: Path) -> bool:
    """Whether an MDF4 file is a log of a bus. Raises `UserError` for a file that is damaged or none of MDF."""
    return any(is_log for is_log, _ in mdf4_apart("observer_rt.files.mdf4.bus_frames:is_log", path))


class Mdf4Log(LogReader):
    """Reader; channels are named by their number. Frames of several groups are put in order of time."""

    unit = "frame"

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        for totals, arrays in mdf4_apart("observer_rt.files.mdf4.bus_frames:frames", self.path):
            self._size, self.error_frames, self.remote_frames, self.other_entries, self.remarks = totals
            records = arrays["records"]
            data = records["data"].tobytes()
            for number, (*fields, channel, is_sent, length) in zip(
                range(0, len(data), MAX_LENGTH), records[list(RECORD.fields or ())[:-1]].tolist(), strict=True
            ):
                self._position += 1
                frame = Frame(fields[0], data[number : number + length], *fields[1:])
                yield self._position, LogFrame(frame, channel, is_sent)


MDF4_LOG = LogFormat(".mf4", Mdf4Log, recognises=is_bus_log)
