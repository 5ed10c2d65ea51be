"""The format `.blf`, Vector's binary log, and its writer: what was flushed can be read whatever happens later."""

import os
import zlib
from datetime import UTC, datetime
from pathlib import Path

from observer_rt.bus.can_frame import length_code
from observer_rt.foundation.errors import UserError
from observer_rt.recording.canlog.blf import (
    CLASSIC,
    CONTAINER,
    EXTENDED_FLAG,
    FD,
    FD_BIT_RATE_SWITCH,
    FD_ERROR_STATE,
    FD_FORMAT,
    FILE_HEADER,
    MARKER,
    OBJECT_HEADER,
    SENT,
    STAMP_V1,
    TYPE_CLASSIC,
    TYPE_CONTAINER,
    TYPE_FD,
    TYPE_MARKER,
    ZLIB,
    BlfLog,
)
from observer_rt.recording.canlog.can_log import (
    NANOSECONDS,
    ChannelNumbers,
    LogFormat,
    LogFrame,
    LogRecorder,
    lost_note,
)

CONTAINER_BYTES = 128 * 1024  # unpacked, as the format's own tools choose it
HEADER_SIZE = 144
FASTEST_PACKING = 1  # of zlib: a fifth larger than its default, three times faster
OLDEST_START = 631_152_000 * NANOSECONDS  # 1990: an earlier time is no date, and is counted from 0
NANOSECOND_UNIT = 2
_MILLISECOND = 1_000_000  # ns
_VERSIONS = (0, 0, 0, 0, 2, 6, 8, 1)  # of the application (none known), of the format
_GROUP = b"observer-rt"


class BlfWriter(LogRecorder):
    """Writer; channels are numbered from 1."""

    def __init__(self, path: Path, start_ns: int) -> None:
        """See `LogWriter`."""
        super().__init__(path, start_ns)
        self._start = start_ns // _MILLISECOND * _MILLISECOND if start_ns >= OLDEST_START else 0
        self._latest = start_ns
        self._objects = 0
        self._unpacked = HEADER_SIZE
        self._buffer: list[bytes] = []
        self._buffered = 0
        self._numbers = ChannelNumbers()
        self._file = path.open("wb")
        self._write_header()

    def write(self, entry: LogFrame) -> None:
        frame = entry.frame
        channel = self._numbers.of(entry.channel)
        flags = SENT if entry.is_sent else 0
        identifier = frame.frame_id | (EXTENDED_FLAG if frame.is_extended else 0)
        length = len(frame.payload)
        if frame.is_fd:
            fd_flags = FD_FORMAT | FD_BIT_RATE_SWITCH * frame.bit_rate_switch
            fd_flags |= FD_ERROR_STATE * frame.error_state_indicator
            dlc = length_code(length)
            body = FD.pack(channel, flags, dlc, identifier, 0, 0, fd_flags, length, frame.payload)
            self._add(TYPE_FD, body, frame.stamp_ns)
        else:
            body = CLASSIC.pack(channel, flags, length, identifier, frame.payload)
            self._add(TYPE_CLASSIC, body, frame.stamp_ns)

    def write_lost(self, frames: int) -> None:
        text = lost_note(frames).encode("ascii")
        white, red = 0xFFFFFF, 0xFF3300
        body = MARKER.pack(0, white, red, 0, len(text), len(_GROUP), 0) + text + _GROUP
        self._add(TYPE_MARKER, body, self._latest)

    @property
    def size(self) -> int:
        """Bytes in the file, without what is not packed yet."""
        return self._file.tell()

    def flush(self) -> None:
        """See `LogRecorder`; costs little, but some of the packing."""
        self._write_container()
        end = self._file.tell()
        self._file.seek(0)
        self._write_header(end)
        self._file.seek(end)
        self._file.flush()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        if not self._file.closed:
            self.flush()
            self._file.close()

    def _add(self, kind: int, body: bytes, stamp_ns: int) -> None:
        if stamp_ns < self._start:
            raise UserError(str(self.path), "a frame is older than the first ones", "split the log there")
        self._latest = max(self._latest, stamp_ns)
        header_size = OBJECT_HEADER.size + STAMP_V1.size
        size = header_size + len(body)
        data = (
            OBJECT_HEADER.pack(b"LOBJ", header_size, 1, size, kind)
            + STAMP_V1.pack(NANOSECOND_UNIT, 0, 0, stamp_ns - self._start)
            + body
            + bytes(size % 4)
        )
        self._objects += 1
        self._buffer.append(data)
        self._buffered += len(data)
        if self._buffered >= CONTAINER_BYTES:
            self._write_container()

    def _write_container(self) -> None:
        if not self._buffer:
            return
        data = b"".join(self._buffer)
        self._buffer, self._buffered = [], 0
        packed = zlib.compress(data, FASTEST_PACKING)
        size = OBJECT_HEADER.size + CONTAINER.size + len(packed)
        self._file.write(
            OBJECT_HEADER.pack(b"LOBJ", OBJECT_HEADER.size, 1, size, TYPE_CONTAINER)
            + CONTAINER.pack(ZLIB, len(data))
            + packed
            + bytes(size % 4)
        )
        self._unpacked += OBJECT_HEADER.size + CONTAINER.size + len(data)

    def _write_header(self, end: int = HEADER_SIZE) -> None:
        header = FILE_HEADER.pack(
            b"LOGG",
            HEADER_SIZE,
            *_VERSIONS,
            end,
            self._unpacked,
            self._objects,
            0,
            *_system_time(self._start),
            *_system_time(self._latest if self._start else 0),
        )
        self._file.write(header.ljust(HEADER_SIZE, b"\0"))


def _system_time(stamp_ns: int) -> tuple[int, ...]:
    """A Windows SYSTEMTIME in UTC; zeros for 0, which stands for no date."""
    if not stamp_ns:
        return (0,) * 8
    seconds, rest = divmod(stamp_ns, NANOSECONDS)
    moment = datetime.fromtimestamp(seconds, UTC)
    day_of_week = moment.isoweekday() % 7
    return (
        moment.year,
        moment.month,
        day_of_week,
        moment.day,
        moment.hour,
        moment.minute,
        moment.second,
        rest // _MILLISECOND,
    )


BLF = LogFormat((".blf",), "Vector, binary", BlfLog, BlfWriter, BlfWriter)
