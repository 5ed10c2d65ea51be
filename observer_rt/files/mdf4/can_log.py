"""CAN frames in MDF4 files: read by a process apart (`mdf4_frames`), written by ASAM's rules for bus logging."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from observer_rt.bus.can_frame import FD_LENGTHS, length_code
from observer_rt.files.canlog.can_log import NANOSECONDS, LogFrame, LogReader, LogWriter, log_frames
from observer_rt.files.checksum import seal
from observer_rt.files.mdf4.blocks import crash_told, mdf4_apart
from observer_rt.files.mdf4.records import count_records
from observer_rt.foundation.sandbox import WorkerError, checked

RECORDS = "observer_rt.files.mdf4.bus_frames"

DATA = "CAN_DataFrame"
MAX_LENGTH = FD_LENGTHS[-1]
_FIELDS = (
    ("BusChannel", "<u1"),
    ("ID", "<u4"),
    ("IDE", "<u1"),
    ("DLC", "<u1"),
    ("DataLength", "<u1"),
    ("DataBytes", f"({MAX_LENGTH},)u1"),
    ("Dir", "<u1"),
    ("EDL", "<u1"),
    ("BRS", "<u1"),
    ("ESI", "<u1"),
)
CHANNEL_NAME = 16  # characters
RECORD = np.dtype(
    [
        ("stamp", np.int64),  # ns since 1970
        ("id", np.uint32),
        ("is_extended", np.bool_),
        ("length", np.uint8),
        ("data", np.uint8, MAX_LENGTH),
        ("is_fd", np.bool_),
        ("channel", f"U{CHANNEL_NAME}"),
        ("bit_rate_switch", np.bool_),
        ("error_state", np.bool_),
        ("is_sent", np.bool_),
    ]
)

_STORED = np.dtype([(f"{DATA}.{name}", kind) for name, kind in _FIELDS])


class Totals(NamedTuple):
    """Numbers of frames of each kind in a log, of entries of other buses, and remarks on these numbers."""

    data: int
    error: int
    remote: int
    other: int
    remarks: tuple[str, ...]


_TOTALS = TypeAdapter(Totals)
_FLAG = TypeAdapter(bool)


def is_bus_log(path: Path) -> bool:
    """Whether an MDF4 file is a log of a bus. Raises `UserError` for a file that is damaged or none of MDF."""
    with crash_told(path):
        return checked(_FLAG, next(mdf4_apart(RECORDS, "is_log", path), None))


class Mdf4Log(LogReader):
    """Reader; channels are named by their number. Frames of several groups are put in order of time."""

    unit = "frame"

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        parts = mdf4_apart(RECORDS, "records", self.path, count_records(self.path).as_json)
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
            for entry in _entries_of(records):
                self._position += 1
                yield self._position, entry


def _records_of(part: Any) -> NDArray[np.void]:
    if not (isinstance(part, np.ndarray) and part.dtype == RECORD and part.ndim == 1):
        raise WorkerError("its reader gave something else than frames")
    if np.any(part["length"] > MAX_LENGTH):
        raise WorkerError(f"its reader gave frames of more than {MAX_LENGTH} bytes")
    return part


def _entries_of(records: NDArray[np.void]) -> Iterator[LogFrame]:
    data = records["data"].tobytes()
    starts = range(0, len(data), MAX_LENGTH)
    payloads = (
        data[start : start + size] for start, size in zip(starts, records["length"].tolist(), strict=True)
    )
    before, after = (
        [records[name].tolist() for name in names]
        for names in (
            ("stamp", "is_extended", "is_fd", "bit_rate_switch", "error_state"),
            ("channel", "is_sent"),
        )
    )
    return log_frames(records["id"].tolist(), payloads, *before, *after)


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

        flat = np.dtype([(name, "S64" if kind.startswith("(") else kind) for name, kind in _FIELDS])
        samples = np.array(self._records, flat).view(_STORED)
        signal = Signal(
            samples=samples,
            timestamps=np.array(self._stamps, np.float64) / NANOSECONDS,
            name=DATA,
            source=SourceInformation(source_type=SOURCE_BUS, bus_type=BUS_TYPE_CAN),
        )
        with MDF(version="4.10") as file, self.path.open("wb+") as handle:
            add_history(file)
            file.header.abs_time = self._start
            file.append(signal)
            file.save(handle, add_history_block=False)
        seal(self.path)
