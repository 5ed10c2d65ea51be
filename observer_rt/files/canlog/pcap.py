"""Captures of SocketCAN by Wireshark, tshark or tcpdump, `.pcapng` and `.pcap`; only read.

A frame stands as the kernel hands it to who listens, behind a heading where all interfaces were captured
(https://www.tcpdump.org/linktypes.html; the blocks of pcapng: draft-ietf-opsawg-pcapng).
"""

import struct
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from observer_rt.bus.can_frame import (
    BIT_RATE_SWITCH,
    CLASSIC_MTU,
    ERROR_FLAG,
    ERROR_STATE,
    EXTENDED_FLAG,
    EXTENDED_MASK,
    HEADER_BYTES,
    REMOTE_FLAG,
)
from observer_rt.bus.links.link import Frame
from observer_rt.files.canlog.can_log import NANOSECONDS, LogFormat, LogFrame, LogReader
from observer_rt.files.canlog.text_log import likeness
from observer_rt.foundation.errors import UserError

READABLE = "capture it again: `tshark -i can0 -w bus.pcapng`"
MOST = 1 << 20  # bytes of a block; a frame has some 100
SECTION = b"\x0a\x0d\x0d\x0a"  # first bytes of pcapng, the same in both orders of bytes
_ORDERS = {b"\x4d\x3c\x2b\x1a": "<", b"\x1a\x2b\x3c\x4d": ">"}  # at byte 8 of a section
_OLD = {  # first bytes of pcap: order of bytes, parts of a second
    b"\xd4\xc3\xb2\xa1": ("<", 10**6),
    b"\xa1\xb2\xc3\xd4": (">", 10**6),
    b"\x4d\x3c\xb2\xa1": ("<", NANOSECONDS),
    b"\xa1\xb2\x3c\x4d": (">", NANOSECONDS),
}
_LINK = 0xFFFF  # the lower bits are the kind of link
_OLD_HEAD = struct.calcsize("20xI")  # bytes before the first packet; the last number is the kind of link
_BLOCK = 12  # bytes of an empty block: kind, length, and the length again at its end
INTERFACE, STATISTICS, PACKET = 1, 5, 6  # kinds of blocks
_NAME, _RESOLUTION, _DROPPED = 2, 9, (5, 7)  # options: of an interface, of its statistics
CAN, ALL, ALL_2 = 227, 113, 276  # kinds of links: one CAN interface; all interfaces, in two ways
_PLACES = {ALL: (14, 1, 16), ALL_2: (0, 10, 20)}  # of the protocol, the direction, the frame
CLASSIC_PROTOCOL, FD_PROTOCOL, SENT = 0x000C, 0x000D, 4
FD_FORMAT = 0x04  # among the flags of CAN FD
_FRAME = "IBBxx"  # identifier with its flags, length, flags of CAN FD


class _Interface(NamedTuple):
    """A source of packets: its name, its kind of link, parts of a second in which its time counts.

    id_order: of the bytes of identifiers: as in the file where all interfaces were captured.
    """

    name: str
    link: int
    ticks: int
    id_order: str


class PcapLog(LogReader):
    """Reader; channels are named by their interface, by number where the capture has no name."""

    unit = "packet"

    def _entries(self) -> Iterator[tuple[int, LogFrame]]:
        with self.path.open("rb") as file:
            mark = file.read(len(SECTION))
            if mark != SECTION and mark not in _OLD:
                looks, rename = likeness(self.path)
                raise UserError(str(self.path), f"is no capture{looks}", rename or READABLE)
            file.seek(0)
            number = 1
            try:
                for interface, time, data in (self._blocks if mark == SECTION else self._packets)(file):
                    self._position = file.tell()
                    frame = self._frame(interface, time * NANOSECONDS // interface.ticks, data)
                    if frame is not None:
                        yield number, frame
                    number += 1
            except EOFError:
                self.remarks.append(f"it ends within packet {number}, which is left out")
            except (ValueError, struct.error) as error:
                self.refuse(number, f"is damaged: {error}", READABLE)

    def _packets(self, file: BinaryIO) -> Iterator[tuple[_Interface, int, bytes]]:
        """Packets of a pcap file, with their times."""
        head = _taken(file, _OLD_HEAD)
        order, ticks = _OLD[head[: len(SECTION)]]
        link = struct.unpack_from(f"{order}20xI", head)[0] & _LINK
        interface = _Interface("1", link, ticks, order if link in _PLACES else ">")
        while head := file.read(1):
            seconds, parts, size, _ = struct.unpack(f"{order}IIII", head + _taken(file, 15))
            yield interface, seconds * ticks + parts, _taken(file, size)

    def _blocks(self, file: BinaryIO) -> Iterator[tuple[_Interface, int, bytes]]:
        """Packets of pcapng, with their times; the other blocks name interfaces and count losses."""
        order = ""
        interfaces: list[_Interface] = []
        while head := file.read(1):
            head += _taken(file, _BLOCK - 1)
            if head.startswith(SECTION):
                order, interfaces = _ORDERS.get(head[8:], ""), []
            if not order:
                raise ValueError("its order of bytes is not known")
            kind, size = struct.unpack_from(f"{order}II", head)
            block = head + _taken(file, size - _BLOCK)
            if struct.unpack_from(f"{order}I", block, size - 4) != (size,):
                raise ValueError("a block does not end with its length")
            if kind == INTERFACE:
                (link,) = struct.unpack_from(f"{order}H", block, 8)
                said = _options(block[16:-4], order)
                words = said.get(_NAME, b"").decode("utf-8", "replace").split() or [str(len(interfaces) + 1)]
                power = said.get(_RESOLUTION, b"\6")[0]
                ticks = 1 << (power & 0x7F) if power & 0x80 else 10**power
                interfaces.append(_Interface("_".join(words), link, ticks, order if link in _PLACES else ">"))
            elif kind == PACKET:
                at, high, low, length = struct.unpack_from(f"{order}IIII", block, 8)
                if at >= len(interfaces) or length > size - 32:
                    raise ValueError("a packet is of no interface, or longer than its block")
                yield interfaces[at], high << 32 | low, block[28 : 28 + length]
            elif kind == STATISTICS:
                said = _options(block[20:-4], order)
                lost = (struct.unpack(f"{order}Q", said[each])[0] for each in _DROPPED if each in said)
                self.lost_frames += sum(lost)

    def _frame(self, interface: _Interface, stamp: int, data: bytes) -> LogFrame | None:
        channel, protocol, is_sent = interface.name, CLASSIC_PROTOCOL, False
        if interface.link in _PLACES:
            place, direction, begin = _PLACES[interface.link]
            if len(data) < begin:
                raise ValueError(f"only {len(data)} bytes of a packet were captured")
            protocol = int.from_bytes(data[place : place + 2], "big")
            is_sent = data[direction] == SENT
            if interface.link == ALL_2:
                channel = str(int.from_bytes(data[4:8], "big"))
            data = data[begin:]
        elif interface.link != CAN:
            raise ValueError(f"link type {interface.link} is none of SocketCAN")
        if protocol not in (CLASSIC_PROTOCOL, FD_PROTOCOL):
            self.other_entries += 1
            return None
        identifier, length, flags = struct.unpack_from(f"{interface.id_order}{_FRAME}", data)
        payload = data[HEADER_BYTES : HEADER_BYTES + length]
        if len(payload) < length:
            raise ValueError(f"only {len(payload)} of {length} bytes of a frame were captured")
        if identifier & ERROR_FLAG:
            self.error_frames += 1
            return None
        if identifier & REMOTE_FLAG:
            self.remote_frames += 1
            return None
        is_fd = protocol == FD_PROTOCOL or bool(flags & FD_FORMAT) or len(data) > CLASSIC_MTU
        frame = Frame(
            identifier & EXTENDED_MASK,
            payload,
            stamp,
            bool(identifier & EXTENDED_FLAG),
            is_fd,
            is_fd and bool(flags & BIT_RATE_SWITCH),
            is_fd and bool(flags & ERROR_STATE),
        )
        return LogFrame(frame, channel, is_sent)


def _taken(file: BinaryIO, size: int) -> bytes:
    """The next bytes. Raises `EOFError` where there are fewer, `ValueError` for a size no capture of CAN has."""
    if not 0 <= size <= MOST:
        raise ValueError(f"{size} bytes are no length of a block")
    data = file.read(size)
    if len(data) < size:
        raise EOFError
    return data


def _options(data: bytes, order: str) -> dict[int, bytes]:
    """Options of a block, by their codes."""
    found: dict[int, bytes] = {}
    while data:
        code, size = struct.unpack_from(f"{order}HH", data)
        if code == 0:
            break
        found[code] = data[4 : 4 + size]
        data = data[4 + size + -size % 4 :]
    return found


PCAP = LogFormat((".pcapng", ".pcap"), "capture of SocketCAN by Wireshark or tcpdump", PcapLog)
