"""CAN frames in MDF4 files, by ASAM's rules for bus logging: one record a frame, apart by data, error and remote."""

import heapq
from collections.abc import Iterable, Iterator
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks.v4_blocks import SourceInformation
from asammdf.blocks.v4_constants import BUS_TYPE_CAN, FLAG_CG_BUS_EVENT, SOURCE_BUS
from numpy.typing import NDArray

from observer_rt.bus.can_frame import EXTENDED_MASK, FD_LENGTHS, length_code
from observer_rt.foundation.file_errors import file_errors
from observer_rt.recording.canlog.can_log import (
    NANOSECONDS,
    ChannelNumbers,
    LogFrame,
    LogReader,
    LogWriter,
)
from observer_rt.recording.signals.mdf4_file import add_history, opened, refuse_outside

DATA, ERROR, REMOTE = "CAN_DataFrame", "CAN_ErrorFrame", "CAN_RemoteFrame"
EXTENDED_BIT = 31  # of identifiers, where a logger stores no IDE
RECORDS_AT_ONCE = 50_000
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

# stamp [ns], identifier, is extended, payload, is FD, channel, bit rate switched, error state, sent
_Record = tuple[int, int, bool, bytes, bool, str, bool, bool, bool]


def is_bus_log(path: Path) -> bool:
    """Whether an MDF4 file holds CAN frames. Raises `UserError` for a file that is damaged or none of MDF."""
    with file_errors(path), opened(path) as file:
        return bool(_groups(file, DATA))


class Mdf4Log(LogReader):
    """Reader; channels are named by their number. Frames of several groups are put in order of time."""

    unit = "frame"

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        with opened(self.path) as file:
            for number, record in enumerate(self._records(file), start=1):
                self._position = number
                yield number, self.frame(number, *record)

    def _records(self, file: MDF) -> Iterable[_Record]:
        self.error_frames = sum(file.groups[group].channel_group.cycles_nr for group in _groups(file, ERROR))
        self.remote_frames = sum(
            file.groups[group].channel_group.cycles_nr for group in _groups(file, REMOTE)
        )
        self._size = sum(file.groups[group].channel_group.cycles_nr for group in _groups(file, DATA))
        groups = [_group_records(file, group) for group in _groups(file, DATA)]
        return heapq.merge(*groups, key=itemgetter(0))


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


def _groups(file: MDF, kind: str) -> list[int]:
    """Numbers of the groups that hold CAN frames of a kind."""
    return [
        number
        for number, group in enumerate(file.groups)
        if group.channel_group.flags & FLAG_CG_BUS_EVENT
        and group.channel_group.cycles_nr
        and any(channel.name == kind for channel in group.channels)
    ]


def _group_records(file: MDF, group: int) -> Iterator[_Record]:
    refuse_outside(file, group)
    names = {channel.name for channel in file.groups[group].channels}
    start_ns = int(file.header.abs_time)
    for offset in range(0, file.groups[group].channel_group.cycles_nr, RECORDS_AT_ONCE):

        def column(field: str, offset: int = offset) -> Signal:
            return file.get(
                f"{DATA}.{field}", group=group, record_offset=offset, record_count=RECORDS_AT_ONCE, raw=True
            )

        def flags(field: str, offset: int = offset) -> list[bool]:
            return (
                [] if f"{DATA}.{field}" not in names else column(field, offset).samples.astype(bool).tolist()
            )

        identifiers = column("ID")
        raw = identifiers.samples.astype(np.int64)
        count = raw.size
        none = [False] * count
        extended = flags("IDE") or (raw >> EXTENDED_BIT).astype(bool).tolist()
        channels = column("BusChannel").samples.tolist() if f"{DATA}.BusChannel" in names else [1] * count
        yield from zip(
            (np.rint(identifiers.timestamps * NANOSECONDS).astype(np.int64) + start_ns).tolist(),
            (raw & EXTENDED_MASK).tolist(),
            extended,
            _payloads(column("DataBytes").samples, column("DataLength").samples),
            flags("EDL") or none,
            map(str, channels),
            flags("BRS") or none,
            flags("ESI") or none,
            flags("Dir") or none,
            strict=True,
        )


def _payloads(data: NDArray[np.uint8], lengths: NDArray[np.integer[Any]]) -> list[bytes]:
    """Data bytes of every frame, from rows padded to one length."""
    width = data.shape[1]
    if int(lengths.max(initial=0)) > width:
        raise ValueError(f"frames of {lengths.max()} bytes in fields of {width}")
    together = np.ascontiguousarray(data).tobytes()
    starts = range(0, width * len(lengths), width)
    return [together[start : start + length] for start, length in zip(starts, lengths.tolist(), strict=True)]
