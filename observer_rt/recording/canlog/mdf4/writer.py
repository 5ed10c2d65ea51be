"""Writer of CAN frames into MDF4 files, by ASAM's rules for bus logging: one record a frame."""

from pathlib import Path

import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks.v4_blocks import SourceInformation
from asammdf.blocks.v4_constants import BUS_TYPE_CAN, SOURCE_BUS

from observer_rt.bus.can_frame import FD_LENGTHS, length_code
from observer_rt.recording.canlog.can_log import NANOSECONDS, ChannelNumbers, LogFrame, LogWriter
from observer_rt.recording.signals.mdf4_file import add_history

DATA = "CAN_DataFrame"
MILLISECOND = 1_000_000  # ns
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
_RECORD = np.dtype([(f"{DATA}.{name}", kind) for name, kind in _FIELDS])


class Mdf4LogWriter(LogWriter):
    """Writer; channels are numbered from 1. All frames are held in memory, the file is written at the end."""

    def __init__(self, path: Path, start_ns: int) -> None:
        """See `LogWriter`."""
        super().__init__(path, start_ns)
        self._start = start_ns // MILLISECOND * MILLISECOND
        self._numbers = ChannelNumbers()
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
        flat = np.dtype([(name, "S64" if kind.startswith("(") else kind) for name, kind in _FIELDS])
        samples = np.array(self._records, flat).view(_RECORD)
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
