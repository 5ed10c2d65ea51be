"""CAN frames in MDF4 files: read by a process apart (`bus_frames`), written by ASAM's rules for bus logging."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from observer_rt.bus.can_frame import FD_LENGTHS, length_code
from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import NANOSECONDS, LogFormat, LogFrame, LogReader, LogWriter
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
_WRITTEN = np.dtype(
    [
        (f"{DATA}.BusChannel", "<u1"),
        (f"{DATA}.ID", "<u4"),
        (f"{DATA}.IDE", "<u1"),
        (f"{DATA}.DLC", "<u1"),
        (f"{DATA}.DataLength", "<u1"),
        (f"{DATA}.DataBytes", f"({MAX_LENGTH},)u1"),
        (f"{DATA}.Dir", "<u1"),
        (f"{DATA}.EDL", "<u1"),
        (f"{DATA}.BRS", "<u1"),
        (f"{DATA}.ESI", "<u1"),
    ]
)
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


class Mdf4LogWriter(LogWriter):
    """Writer; channels are numbered from 1. All frames are held in memory, the file is written at the end."""

    start_step = NANOSECONDS // 1000

    def __init__(self, path: Path, start_ns: int) -> None:
        """See `LogWriter`."""
        super().__init__(path, start_ns)
        self._stamps: list[int] = []
        self._records: list[tuple[int, int, bool, int, int, bytes, bool, bool, bool, bool]] = []

    def write(self, entry: LogFrame) -> None:
        frame = entry.frame
        length = len(frame.payload)
        self._stamps.append(frame.stamp_ns - self._start)
        self._records.append(
            (
                self._numbers.of(entry.channel),
                frame.frame_id,
                frame.is_extended,
                length_code(length),
                length,
                frame.payload.ljust(MAX_LENGTH, b"\0"),
                entry.is_sent,
                frame.is_fd,
                frame.bit_rate_switch,
                frame.error_state_indicator,
            )
        )

    def close(self) -> None:
        from asammdf import MDF, Signal  # slow to import
        from asammdf.blocks.v4_blocks import SourceInformation
        from asammdf.blocks.v4_constants import BUS_TYPE_CAN, SOURCE_BUS

        from observer_rt.files.mdf4.opening import add_history

        flat = np.dtype(
            [(name, "S64" if _WRITTEN[name].shape else _WRITTEN[name]) for name in _WRITTEN.fields or ()]
        )
        signal = Signal(
            samples=np.array(self._records, flat).view(_WRITTEN),
            timestamps=np.array(self._stamps, np.float64) / NANOSECONDS,
            name=DATA,
            source=SourceInformation(source_type=SOURCE_BUS, bus_type=BUS_TYPE_CAN),
        )
        with MDF(version="4.10") as file, self.path.open("wb+") as handle:
            add_history(file)
            file.header.abs_time = self._start
            file.append(signal)
            file.save(handle, add_history_block=False)


MDF4_LOG = LogFormat(".mf4", Mdf4Log, Mdf4LogWriter, recognises=is_bus_log)
