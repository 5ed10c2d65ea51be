"""Logs of Vector's tools, `.blf`: zlib-packed containers of objects, times in ns (or 10 us) after a start.

Read here by python-can's layout: itself it takes requests for frames and times before the start for centuries, and
says nothing of a missing end, unknown objects, and lost frames. It writes.
"""

import os
import struct
import zlib
from collections.abc import Iterator
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import BinaryIO

import can
from can.io import blf as layout

from observer_rt.bus.can_frame import CLASSIC_LENGTH, EXTENDED_FLAG, EXTENDED_MASK, length_of
from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import ZEROS, LogFormat, LogFrame, LogReader, LogWriter, lost_note
from observer_rt.files.canlog.text_log import other_kind
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import NANOSECONDS, NANOSECONDS_PER_MS, NANOSECONDS_PER_US

LOST = struct.Struct("<LLqL")  # queue, -, time, number of events
TYPE_OVERRUN, TYPE_LOST_BEGIN, TYPE_LOST_END = 91, 125, 126
ERROR_TYPES = frozenset((2, 3, 73, 104))  # error, overload, extended error, FD error
FRAME_TYPES = (layout.CAN_MESSAGE, layout.CAN_MESSAGE2, layout.CAN_FD_MESSAGE, layout.CAN_FD_MESSAGE_64)
SENT, REQUESTED, DIRECTION = 1, 2, 0xF
FD_64_REMOTE, FD_64_SHIFT = 0x10, 12  # among the flags of CAN_FD_MESSAGE_64, those of CAN FD begin there
READABLE = "give a complete BLF file"
OLDEST_START = 631_152_000 * NANOSECONDS  # 1990: an earlier time is no date in BLF, and is counted from 0
FASTEST_PACKING = 1  # of zlib: a fifth larger than its default, three times faster
_MARK = b"LOBJ"
_LONGEST_PADDING = 8
_ZEROS_AT_ONCE = 1 << 20  # bytes
_HEAD = layout.OBJ_HEADER_BASE_STRUCT


class BlfLog(LogReader):
    """Reader; channels are numbered from 1 and named by their number."""

    unit = "object"

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        with self.path.open("rb") as file:
            start, stated = self._read_heading(file)
            data, number = b"", 0
            for part in self._parts(file):
                self._position = file.tell()
                data += part
                position = 0
                while (block := self._next_object(data, position, number + 1)) is not None:
                    begin, position = block
                    number += 1
                    entry = self._object_frame(data[begin:position], number, start)
                    if entry is not None:
                        yield number, entry
                data = data[position:]
            if data.strip(b"\0"):
                self.remarks.append(f"it ends within object {number + 1}, which is left out")
            elif stated > number and not self.remarks:
                self.remarks.append(f"its heading counts {stated} objects, {number} are in it")

    def _read_heading(self, file: BinaryIO) -> tuple[int, int]:
        """Read the heading: start [ns since 1970], number of objects, 0 where it was not completed."""
        data = file.read(layout.FILE_HEADER_STRUCT.size)
        if not data.startswith(b"LOGG"):
            raise UserError(str(self.path), "is no BLF file", other_kind(self.path) or READABLE)
        fields = layout.FILE_HEADER_STRUCT.unpack(data.ljust(layout.FILE_HEADER_STRUCT.size, b"\0"))
        if max(fields[1], layout.FILE_HEADER_STRUCT.size) > self._size:
            raise UserError(str(self.path), "ends within its header", READABLE)
        file.seek(fields[1])
        if fields[10] > self._size:
            self.remarks.append(f"its last {fields[10] - self._size} bytes are missing")
        year, month, _, day, hour, minute, second, millisecond = fields[14:22]
        try:
            moment = datetime(year, month, day, hour, minute, second, millisecond * 1000, UTC)
        except ValueError:
            if any(fields[14:22]):
                self.remarks.append("its start is no date: times count from 1970")
            return 0, fields[12]
        return int(moment.timestamp()) * NANOSECONDS + millisecond * NANOSECONDS_PER_MS, fields[12]

    def _parts(self, file: BinaryIO) -> Iterator[bytes]:
        """The objects, unpacked, in pieces that end anywhere."""
        container = 0
        while head := file.read(_HEAD.size):
            container += 1
            zeros = self._size - file.tell() + len(head)
            if not any(head) and not any(map(any, iter(partial(file.read, _ZEROS_AT_ONCE), b""))):
                self.remarks.append(ZEROS.format(zeros))
                return
            begin = max(0, head.find(_MARK, 0, _LONGEST_PADDING + len(_MARK)))
            head = head[begin:] + file.read(begin)
            location = f"{self.path}, container {container}"
            mark, _, _, size, kind = _HEAD.unpack(head.ljust(_HEAD.size, b"\0"))
            if len(head) == _HEAD.size and (mark != _MARK or size < _HEAD.size):
                raise UserError(location, "is damaged: no object begins where one should", READABLE)
            if len(head) < _HEAD.size or size - _HEAD.size > self._size - file.tell():
                self.remarks.append(f"it ends within container {container}, whose frames are lost")
                return
            body = file.read(size - _HEAD.size)
            padding = file.read(size % 4)
            yield self._unpacked(body, location) if kind == layout.LOG_CONTAINER else head + body + padding

    def _unpacked(self, body: bytes, location: str) -> bytes:
        if len(body) < layout.LOG_CONTAINER_STRUCT.size:
            raise UserError(location, "is damaged: shorter than its own header", READABLE)
        packing, size = layout.LOG_CONTAINER_STRUCT.unpack_from(body)
        data = body[layout.LOG_CONTAINER_STRUCT.size :]
        if packing == layout.ZLIB_DEFLATE:
            try:
                data = zlib.decompress(data)
            except zlib.error as error:
                raise UserError(location, f"is damaged: {error}", READABLE) from None
        elif packing != layout.NO_COMPRESSION:
            raise UserError(location, f"is packed in a way unknown here ({packing})", "save it again unpacked")
        if len(data) < size:
            raise UserError(location, f"is damaged: {len(data)} bytes instead of {size}", READABLE)
        return data

    def _next_object(self, data: bytes, position: int, number: int) -> tuple[int, int] | None:
        """Start and end of the next whole object; None if it is not all there yet."""
        start = data.find(_MARK, position)
        between = data[position : start if start >= 0 else None].lstrip(b"\0")  # some tools pad with many
        if len(between) > (_LONGEST_PADDING if start >= 0 else _LONGEST_PADDING + len(_MARK)):
            self.refuse(number, "no object begins where one should", READABLE)
        if start < 0 or len(data) - start < _HEAD.size:
            return None
        size = _HEAD.unpack_from(data, start)[3]
        if size < _HEAD.size:
            self.refuse(number, f"{size} bytes are no length of an object", READABLE)
        return (start, start + size) if start + size <= len(data) else None

    def _object_frame(self, data: bytes, number: int, start: int) -> LogFrame | None:
        """The data frame of an object, if it is one that was on the bus; stamps count from `start` [ns]."""
        _, header_size, version, _, kind = _HEAD.unpack_from(data)
        if kind in ERROR_TYPES:
            self.error_frames += 1
            return None
        try:
            if kind in FRAME_TYPES:
                return self._frame(data, header_size, kind, start + _stamp(data, version))
            self._take_other(data[header_size:], kind)
        except struct.error:
            self.refuse(number, f"is too short for its type {kind}", READABLE)
        except ValueError as error:
            self.refuse(number, str(error), READABLE)
        return None

    def _take_other(self, body: bytes, kind: int) -> None:
        lost = self.lost_frames
        if kind == layout.GLOBAL_MARKER:
            length = layout.GLOBAL_MARKER_STRUCT.unpack_from(body)[4]
            first = layout.GLOBAL_MARKER_STRUCT.size
            self.note_text(body[first : first + length].decode("ascii", errors="replace"))
        elif kind == TYPE_LOST_END:
            self.lost_frames += LOST.unpack_from(body)[3]
        elif kind == TYPE_OVERRUN:
            self.remarks.append("its recorder had no room for all frames: some were lost")
        self.other_entries += self.lost_frames == lost and kind not in (TYPE_OVERRUN, TYPE_LOST_BEGIN)

    def _frame(self, data: bytes, body: int, kind: int, stamp: int) -> LogFrame | None:
        fd_flags = 0
        if kind == layout.CAN_FD_MESSAGE:
            fields = layout.CAN_FD_MSG_STRUCT.unpack_from(data, body)
            channel, flags, _, identifier, _, _, fd_flags, valid, payload = fields
            direction, is_remote, payload = flags & DIRECTION, flags & layout.REMOTE_FLAG, payload[:valid]
        elif kind == layout.CAN_FD_MESSAGE_64:
            fields = layout.CAN_FD_MSG_64_STRUCT.unpack_from(data, body)
            channel, dlc, valid, _, identifier, _, flags, *_, direction, more, _ = fields
            is_remote, fd_flags = flags & FD_64_REMOTE, flags >> FD_64_SHIFT
            first = body + layout.CAN_FD_MSG_64_STRUCT.size
            length = length_of(dlc) if fd_flags & layout.EDL else min(dlc, CLASSIC_LENGTH)
            # what follows the data begins at `more`; bytes that are not stored are zero, as Vector's tools take them
            payload = data[first : min(more or len(data), first + valid)].ljust(length, b"\0")
        else:
            channel, flags, dlc, identifier, payload = layout.CAN_MSG_STRUCT.unpack_from(data, body)
            direction, is_remote = flags & DIRECTION, flags & layout.REMOTE_FLAG
            payload = payload[: min(dlc, CLASSIC_LENGTH)]
        if direction == REQUESTED:
            self.other_entries += 1  # asked for, and not yet on the bus
            return None
        if is_remote:
            self.remote_frames += 1
            return None
        frame = Frame(
            identifier & EXTENDED_MASK,
            payload,
            stamp,
            bool(identifier & EXTENDED_FLAG),
            bool(fd_flags & layout.EDL),
            bool(fd_flags & layout.BRS),
            bool(fd_flags & layout.ESI),
        )
        return LogFrame(frame, str(channel), direction == SENT)


def _stamp(data: bytes, version: int) -> int:
    """Time of an object [ns] after the start of the file, before it if negative."""
    layouts = {1: layout.OBJ_HEADER_V1_STRUCT, 2: layout.OBJ_HEADER_V2_STRUCT}
    if version not in layouts:
        raise ValueError(f"has an object header of unknown version {version}")
    unit, *_, time = layouts[version].unpack_from(data, _HEAD.size)
    time -= (time >> 63) << 64
    return int(time) * (10_000 if unit == layout.TIME_TEN_MICS else 1)


class _FlushedBlf(can.BLFWriter):
    """python-can's writer, whose file can also be completed while it goes on."""

    def flush(self) -> None:
        """Write what was kept for the next container, and how much there is."""
        self._flush()
        end = self.file.seek(0, os.SEEK_END)
        self.file.seek(0)
        self._write_header(end)
        self.file.seek(end)
        self.file.flush()
        os.fsync(self.file.fileno())


class BlfWriter(LogWriter):
    """Writer by python-can: stamps are float seconds there, off by less than 1 us. Channels count from 1."""

    def __init__(self, path: Path, start_ns: int) -> None:
        super().__init__(path, start_ns // NANOSECONDS_PER_MS * NANOSECONDS_PER_MS if start_ns >= OLDEST_START else 0)
        self._writer = _FlushedBlf(path, compression_level=FASTEST_PACKING)
        self._writer.start_timestamp = self._writer.stop_timestamp = self._start / NANOSECONDS

    def write(self, entry: LogFrame) -> None:
        frame = entry.frame
        if frame.stamp_ns < self._start:
            raise UserError(str(self.path), "a frame is older than the first ones", "split the log there")
        self._writer.on_message_received(
            can.Message(
                timestamp=frame.stamp_ns / NANOSECONDS,
                arbitration_id=frame.frame_id,
                is_extended_id=frame.is_extended,
                data=frame.payload,
                is_fd=frame.is_fd,
                bitrate_switch=frame.bit_rate_switch,
                error_state_indicator=frame.error_state_indicator,
                is_rx=not entry.is_sent,
                channel=self._numbers.of(entry.channel) - 1,
            )
        )

    def write_lost(self, frames: int) -> None:
        self._writer.log_event(lost_note(frames))

    def flush(self) -> None:
        self._writer.flush()

    def close(self) -> None:
        if not self._writer.file.closed:
            self._writer.stop()


BLF = LogFormat(".blf", BlfLog, BlfWriter, stamp_step=NANOSECONDS_PER_US)
