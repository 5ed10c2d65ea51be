"""Reader of `.blf`, Vector's binary log: zlib-packed containers of objects, times in ns (or 10 us) after a start.

No specification is published; the layout is what public readers of the format agree on.
"""

import struct
import zlib
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import BinaryIO, NamedTuple

from observer_rt.bus.can_frame import CLASSIC_LENGTH, EXTENDED_MASK, length_of
from observer_rt.foundation.errors import UserError
from observer_rt.recording.canlog.can_log import NANOSECONDS, LogFrame, LogReader
from observer_rt.recording.canlog.text_log import likeness

# "LOGG", header size, 8 bytes of versions, file size, uncompressed size, objects, objects read, start, end
FILE_HEADER = struct.Struct("<4sL8BQQLL8H8H")
OBJECT_HEADER = struct.Struct("<4sHHLL")  # "LOBJ", header size, header version, object size, type
STAMP_V1 = struct.Struct("<LHHQ")  # flags (unit of time), client, object version, time
STAMP_V2 = struct.Struct("<LBxHQ8x")
CONTAINER = struct.Struct("<H6xL4x")  # packing, unpacked size
CLASSIC = struct.Struct("<HBBL8s")  # channel, flags, dlc, identifier, data
FD = struct.Struct("<HBBLLBBB5x64s")  # ..., duration, bit count, FD flags, valid bytes, data
FD_64 = struct.Struct("<BBBBLLLLLLLHBBL")  # channel, dlc, valid bytes, ..., direction, offset of more, crc
MARKER = struct.Struct("<LLL3xBLLL12x")  # event, colours, relocatable, lengths of group, marker, description

TYPE_CLASSIC, TYPE_CLASSIC_2, TYPE_FD, TYPE_FD_64 = 1, 86, 100, 101
TYPE_CONTAINER, TYPE_MARKER = 10, 96
ERROR_TYPES = frozenset((2, 3, 73, 104))  # error, overload, extended error, FD error
PLAIN, ZLIB = 0, 2
TEN_MICROSECONDS = 1  # unit of time
EXTENDED_FLAG = 0x8000_0000
SENT, REMOTE = 0x01, 0x80
FD_FORMAT, FD_BIT_RATE_SWITCH, FD_ERROR_STATE = 0x1, 0x2, 0x4
FD_64_REMOTE, FD_64_FORMAT, FD_64_BIT_RATE_SWITCH, FD_64_ERROR_STATE = 0x10, 0x1000, 0x2000, 0x4000
READABLE = "give a complete BLF file"
_MARK = b"LOBJ"
_LONGEST_PADDING = 8


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
        return int(moment.timestamp()) * NANOSECONDS + millisecond * 1_000_000

    def _parts(self, file: BinaryIO, header: _Header) -> Iterator[bytes]:
        """The objects, unpacked, in pieces that end anywhere."""
        container = 0
        while head := file.read(OBJECT_HEADER.size):
            container += 1
            begin = max(0, head.find(_MARK, 0, _LONGEST_PADDING + len(_MARK)))
            head = head[begin:] + file.read(begin)
            place = f"{self.path}, container {container}"
            if len(head) < OBJECT_HEADER.size:
                self._cut(container)
                return
            mark, _, _, size, kind = OBJECT_HEADER.unpack(head)
            if mark != _MARK or size < OBJECT_HEADER.size:
                raise UserError(place, "is damaged: no object begins where one should", READABLE)
            body = file.read(size - OBJECT_HEADER.size)
            if len(body) < size - OBJECT_HEADER.size:
                self._cut(container)
                return
            padding = file.read(size % 4)
            if kind == TYPE_CONTAINER:
                yield self._unpacked(body, place)
            else:
                yield head + body + padding
        if header.file_size > file.tell():
            self.remarks.append(f"its last {header.file_size - file.tell()} bytes are missing")

    def _cut(self, container: int) -> None:
        self.remarks.append(f"it ends within container {container}, whose frames are lost")

    def _unpacked(self, body: bytes, place: str) -> bytes:
        if len(body) < CONTAINER.size:
            raise UserError(place, "is damaged: shorter than its own header", READABLE)
        packing, size = CONTAINER.unpack_from(body)
        if packing not in (PLAIN, ZLIB):
            raise UserError(place, f"is packed in a way unknown here ({packing})", "save it again unpacked")
        data = body[CONTAINER.size :]
        try:
            data = zlib.decompress(data) if packing == ZLIB else data
        except zlib.error as error:
            raise UserError(place, f"is damaged: {error}", READABLE) from None
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
            body = start + header_size
            if kind == TYPE_FD:
                return self._fd(data, body, number, stamp)
            if kind == TYPE_FD_64:
                return self._fd_64(data, start, end, number, stamp)
            return self._classic(data, body, number, stamp)
        except struct.error:
            self.refuse(number, f"is too short for its type {kind}", READABLE)
        except ValueError as error:
            self.refuse(number, str(error), READABLE)

    def _marker(self, data: bytes, body: int) -> bool:
        """Whether a marker says that frames were lost."""
        lost = self.lost_frames
        if body + MARKER.size <= len(data):
            length = MARKER.unpack_from(data, body)[4]
            text = data[body + MARKER.size : body + MARKER.size + length]
            self.note_text(text.decode("ascii", errors="replace"))
        return self.lost_frames > lost

    def _classic(self, data: bytes, body: int, number: int, stamp: int) -> LogFrame | None:
        channel, flags, dlc, identifier, payload = CLASSIC.unpack_from(data, body)
        if flags & REMOTE:
            self.remote_frames += 1
            return None
        length = min(dlc, CLASSIC_LENGTH)
        return self._data_frame(number, stamp, identifier, payload[:length], channel, flags & SENT)

    def _fd(self, data: bytes, body: int, number: int, stamp: int) -> LogFrame | None:
        channel, flags, _, identifier, _, _, fd_flags, valid, payload = FD.unpack_from(data, body)
        if flags & REMOTE:
            self.remote_frames += 1
            return None
        return self._data_frame(
            number,
            stamp,
            identifier,
            payload[:valid],
            channel,
            flags & SENT,
            fd_flags & FD_FORMAT,
            fd_flags & FD_BIT_RATE_SWITCH,
            fd_flags & FD_ERROR_STATE,
        )

    def _fd_64(self, data: bytes, start: int, end: int, number: int, stamp: int) -> LogFrame | None:
        body = start + OBJECT_HEADER.unpack_from(data, start)[1]
        fields = FD_64.unpack_from(data, body)
        channel, dlc, valid, identifier, flags = fields[0], fields[1], fields[2], fields[4], fields[6]
        if flags & FD_64_REMOTE:
            self.remote_frames += 1
            return None
        first = body + FD_64.size
        more = fields[13]  # where it begins, after the object's start; 0: nothing follows the data
        last = min(end, start + more) if more else end
        length = length_of(dlc) if flags & FD_64_FORMAT else min(dlc, CLASSIC_LENGTH)
        # bytes that are not stored are zero, as the format's own tools take them
        payload = data[first : min(last, first + valid)].ljust(length, b"\0")
        return self._data_frame(
            number,
            stamp,
            identifier,
            payload,
            channel,
            fields[12],
            flags & FD_64_FORMAT,
            flags & FD_64_BIT_RATE_SWITCH,
            flags & FD_64_ERROR_STATE,
        )

    def _data_frame(
        self,
        number: int,
        stamp: int,
        identifier: int,
        payload: bytes,
        channel: int,
        sent: int,
        fd: int = 0,
        bit_rate_switch: int = 0,
        error_state: int = 0,
    ) -> LogFrame:
        return self.frame(
            number,
            stamp,
            identifier & EXTENDED_MASK,
            bool(identifier & EXTENDED_FLAG),
            payload,
            bool(fd),
            str(channel),
            bool(bit_rate_switch),
            bool(error_state),
            bool(sent),
        )


def _stamp(data: bytes, position: int, version: int) -> int:
    """Time of an object [ns] after the start of the file."""
    if version not in (1, 2):
        raise ValueError(f"has an object header of unknown version {version}")
    unit, *_, time = (STAMP_V1 if version == 1 else STAMP_V2).unpack_from(data, position)
    return int(time) * (10_000 if unit == TEN_MICROSECONDS else 1)
