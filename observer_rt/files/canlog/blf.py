"""Logs of Vector's tools, `.blf`: zlib-packed containers of objects, times in ns (or 10 us) after a start.

No specification is published; the layout is what public readers of the format agree on. What the writer flushed can
be read whatever happens later.
"""

import os
import struct
import zlib
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO, NamedTuple

from observer_rt.bus.can_frame import CLASSIC_LENGTH, EXTENDED_FLAG, EXTENDED_MASK, length_code, length_of
from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import (
    NANOSECONDS,
    LogFormat,
    LogFrame,
    LogReader,
    LogRecorder,
    lost_note,
)
from observer_rt.files.canlog.text_log import likeness
from observer_rt.foundation.errors import UserError

# "LOGG", header size, 8 bytes of versions, file size, uncompressed size, objects, objects read, start, end
FILE_HEADER = struct.Struct("<4sL8BQQLL8H8H")
OBJECT_HEADER = struct.Struct("<4sHHLL")  # "LOBJ", header size, header version, object size, type
STAMP_V1 = struct.Struct("<LHHQ")  # flags (unit of time), client, object version, time
STAMP_V2 = struct.Struct("<LBxHQ8x")
MOST_UNPACKED = 1 << 28  # bytes of a container, which has some 100 KB
CONTAINER = struct.Struct("<H6xL4x")  # packing, unpacked size
CLASSIC = struct.Struct("<HBBL8s")  # channel, flags, dlc, identifier, data
FD = struct.Struct("<HBBLLBBB5x64s")  # ..., duration, bit count, FD flags, valid bytes, data
FD_64 = struct.Struct("<BBBBLLLLLLLHBBL")  # channel, dlc, valid bytes, ..., direction, offset of more, crc
MARKER = struct.Struct("<LLL3xBLLL12x")  # event, colours, relocatable, lengths of group, marker, description

TYPE_CLASSIC, TYPE_CLASSIC_2, TYPE_FD, TYPE_FD_64 = 1, 86, 100, 101
TYPE_CONTAINER, TYPE_MARKER = 10, 96
ERROR_TYPES = frozenset((2, 3, 73, 104))  # error, overload, extended error, FD error
PLAIN, ZLIB = 0, 2
TEN_MICROSECONDS, NANOSECOND_UNIT = 1, 2  # units of time
SENT, REMOTE = 0x01, 0x80
FD_FORMAT, FD_BIT_RATE_SWITCH, FD_ERROR_STATE = 0x1, 0x2, 0x4
FD_64_REMOTE = 0x10
FD_64_SHIFT = 12  # of the three flags of CAN FD in those of FD_64
READABLE = "give a complete BLF file"
_MARK = b"LOBJ"
_LONGEST_PADDING = 8
MILLISECOND = 1_000_000  # ns

CONTAINER_BYTES = 128 * 1024  # unpacked, as the format's own tools choose it
HEADER_SIZE = 144
FASTEST_PACKING = 1  # of zlib: a fifth larger than its default, three times faster
OLDEST_START = 631_152_000 * NANOSECONDS  # 1990: an earlier time is no date, and is counted from 0
_VERSIONS = (0, 0, 0, 0, 2, 6, 8, 1)  # of the application (none known), of the format
_GROUP = b"observer-rt"


class _Header(NamedTuple):
    size: int
    file_size: int
    start_ns: int


class BlfLog(LogReader):
    """Reader; channels are numbered from 1 and named by their number."""

    unit = "object"

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        with self.path.open("rb") as file:
            header = self._header(file)
            data = b""
            number = 0
            for part in self._parts(file, header):
                self._position = file.tell()
                data += part
                position = 0
                while (found := self._next(data, position, number + 1)) is not None:
                    start, end = found
                    number += 1
                    entry = self._object(data, start, end, number, header.start_ns)
                    if entry is not None:
                        yield number, entry
                    position = end
                data = data[position:]
            if data.strip(b"\0"):
                self.remarks.append(f"it ends within object {number + 1}, which is left out")

    def _header(self, file: BinaryIO) -> _Header:
        data = file.read(FILE_HEADER.size)
        if len(data) < FILE_HEADER.size or not data.startswith(b"LOGG"):
            if data and not b"LOGG".startswith(data[:4]):
                looks, rename = likeness(self.path)
                raise UserError(str(self.path), f"is no BLF file{looks}", rename or READABLE)
            raise UserError(str(self.path), "ends within its header", READABLE)
        fields = FILE_HEADER.unpack(data)
        header = _Header(fields[1], fields[10], self._start(fields[14:22]))
        if header.size > self._size:
            raise UserError(str(self.path), "ends within its header", READABLE)
        file.seek(header.size)
        return header

    def _start(self, system_time: tuple[int, ...]) -> int:
        """A Windows SYSTEMTIME, taken as UTC, in ns since 1970; 0 where none is stored, or none that can be."""
        year, month, _, day, hour, minute, second, millisecond = system_time
        try:
            moment = datetime(year, month, day, hour, minute, second, tzinfo=UTC)
        except ValueError:
            if any(system_time):
                date = f"{year}-{month:02}-{day:02} {hour:02}:{minute:02}:{second:02}"
                self.remarks.append(f"its start, {date}, is no date: times count from 1970")
            return 0
        return int(moment.timestamp()) * NANOSECONDS + millisecond * MILLISECOND

    def _parts(self, file: BinaryIO, header: _Header) -> Iterator[bytes]:
        """The objects, unpacked, in pieces that end anywhere."""
        container = 0
        while head := file.read(OBJECT_HEADER.size):
            container += 1
            begin = max(0, head.find(_MARK, 0, _LONGEST_PADDING + len(_MARK)))
            head = head[begin:] + file.read(begin)
            place = f"{self.path}, container {container}"
            cut = f"it ends within container {container}, whose frames are lost"
            if len(head) < OBJECT_HEADER.size:
                self.remarks.append(cut)
                return
            mark, _, _, size, kind = OBJECT_HEADER.unpack(head)
            if mark != _MARK or size < OBJECT_HEADER.size:
                raise UserError(place, "is damaged: no object begins where one should", READABLE)
            if size - OBJECT_HEADER.size > self._size - file.tell():
                self.remarks.append(cut)
                return
            body = file.read(size - OBJECT_HEADER.size)
            padding = file.read(size % 4)
            if kind == TYPE_CONTAINER:
                yield self._unpacked(body, place)
            else:
                yield head + body + padding
        if header.file_size > file.tell():
            self.remarks.append(f"its last {header.file_size - file.tell()} bytes are missing")

    def _unpacked(self, body: bytes, place: str) -> bytes:
        if len(body) < CONTAINER.size:
            raise UserError(place, "is damaged: shorter than its own header", READABLE)
        packing, size = CONTAINER.unpack_from(body)
        if packing not in (PLAIN, ZLIB):
            raise UserError(place, f"is packed in a way unknown here ({packing})", "save it again unpacked")
        data = body[CONTAINER.size :]
        if packing == ZLIB:
            unpacker = zlib.decompressobj()
            try:
                data = unpacker.decompress(data, MOST_UNPACKED)
            except zlib.error as error:
                raise UserError(place, f"is damaged: {error}", READABLE) from None
            if not unpacker.eof:
                raise UserError(place, "is damaged: what is packed does not end", READABLE)
        if len(data) < size:
            raise UserError(place, f"is damaged: {len(data)} bytes instead of {size}", READABLE)
        return data

    def _next(self, data: bytes, position: int, number: int) -> tuple[int, int] | None:
        """Start and end of the next whole object; None if it is not all there yet."""
        start = data.find(_MARK, position)
        between = data[position : start if start >= 0 else None].lstrip(b"\0")  # some tools pad with many
        if len(between) > (_LONGEST_PADDING if start >= 0 else _LONGEST_PADDING + len(_MARK)):
            self.refuse(number, "no object begins where one should", READABLE)
        if start < 0:
            return None
        if len(data) - start < OBJECT_HEADER.size:
            return None
        size = OBJECT_HEADER.unpack_from(data, start)[3]
        if size < OBJECT_HEADER.size:
            self.refuse(number, f"{size} bytes are no length of an object", READABLE)
        return (start, start + size) if start + size <= len(data) else None

    def _object(self, data: bytes, start: int, end: int, number: int, start_ns: int) -> LogFrame | None:
        _, header_size, version, _, kind = OBJECT_HEADER.unpack_from(data, start)
        if kind in ERROR_TYPES:
            self.error_frames += 1
            return None
        if kind not in (TYPE_CLASSIC, TYPE_CLASSIC_2, TYPE_FD, TYPE_FD_64):
            self.other_entries += kind != TYPE_MARKER or not self._marker(data, start + header_size)
            return None
        try:
            stamp = start_ns + _stamp(data, start + OBJECT_HEADER.size, version)
            return self._data_frame(data, start, end, kind, stamp)
        except struct.error:
            self.refuse(number, f"is too short for its type {kind}", READABLE)
        except ValueError as error:
            self.refuse(number, str(error), READABLE)

    def _marker(self, data: bytes, body: int) -> bool:
        """Whether a marker reports lost frames, which are counted."""
        lost = self.lost_frames
        if body + MARKER.size <= len(data):
            length = MARKER.unpack_from(data, body)[4]
            text = data[body + MARKER.size : body + MARKER.size + length]
            self.note_text(text.decode("ascii", errors="replace"))
        return self.lost_frames > lost

    def _data_frame(self, data: bytes, start: int, end: int, kind: int, stamp: int) -> LogFrame | None:
        body = start + OBJECT_HEADER.unpack_from(data, start)[1]
        if kind == TYPE_FD:
            channel, flags, _, identifier, _, _, fd_flags, valid, payload = FD.unpack_from(data, body)
            payload = payload[:valid]
        elif kind == TYPE_FD_64:
            fields = FD_64.unpack_from(data, body)
            channel, dlc, valid, _, identifier, _, more_flags, *_, is_sent, more, _ = fields
            fd_flags = more_flags >> FD_64_SHIFT
            flags = SENT * bool(is_sent) | REMOTE * bool(more_flags & FD_64_REMOTE)
            first = body + FD_64.size
            last = min(end, start + more) if more else end  # where more begins; 0: nothing follows the data
            length = length_of(dlc) if fd_flags & FD_FORMAT else min(dlc, CLASSIC_LENGTH)
            # bytes that are not stored are zero, as the format's own tools take them
            payload = data[first : min(last, first + valid)].ljust(length, b"\0")
        else:
            channel, flags, dlc, identifier, payload = CLASSIC.unpack_from(data, body)
            payload, fd_flags = payload[: min(dlc, CLASSIC_LENGTH)], 0
        if flags & REMOTE:
            self.remote_frames += 1
            return None
        frame = Frame(
            identifier & EXTENDED_MASK,
            payload,
            stamp,
            bool(identifier & EXTENDED_FLAG),
            bool(fd_flags & FD_FORMAT),
            bool(fd_flags & FD_BIT_RATE_SWITCH),
            bool(fd_flags & FD_ERROR_STATE),
        )
        return LogFrame(frame, str(channel), bool(flags & SENT))


def _stamp(data: bytes, position: int, version: int) -> int:
    """Time of an object [ns] after the start of the file."""
    if version not in (1, 2):
        raise ValueError(f"has an object header of unknown version {version}")
    unit, *_, time = (STAMP_V1 if version == 1 else STAMP_V2).unpack_from(data, position)
    return int(time) * (10_000 if unit == TEN_MICROSECONDS else 1)


class BlfWriter(LogRecorder):
    """Writer; channels are numbered from 1."""

    start_step = MILLISECOND

    def __init__(self, path: Path, start_ns: int) -> None:
        """See `LogWriter`."""
        super().__init__(path, start_ns if start_ns >= OLDEST_START else 0)
        self._latest = start_ns
        self._objects = 0
        self._unpacked = HEADER_SIZE
        self._buffer: list[bytes] = []
        self._buffered = 0
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
        since_start = self._since_start(stamp_ns)
        self._latest = max(self._latest, stamp_ns)
        header_size = OBJECT_HEADER.size + STAMP_V1.size
        size = header_size + len(body)
        data = (
            OBJECT_HEADER.pack(b"LOBJ", header_size, 1, size, kind)
            + STAMP_V1.pack(NANOSECOND_UNIT, 0, 0, since_start)
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
        rest // MILLISECOND,
    )


BLF = LogFormat((".blf",), "Vector, binary", BlfLog, BlfWriter, BlfWriter)
