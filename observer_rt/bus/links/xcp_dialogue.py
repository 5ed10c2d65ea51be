"""Dialogue with an ECU by XCP on CAN (ASAM MCD-1 XCP 1.x): one list of measurements, asked for and started.

Names of commands are the standard's. What the ECU then sends by itself is read elsewhere.
"""

import struct
import time
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from observer_rt.bus.can_frame import STANDARD_MASK
from observer_rt.bus.links.link import Link, LinkDownError
from observer_rt.config.xcp import DATA_TYPES, MeasurementConfig, XcpConfig
from observer_rt.foundation.errors import RunError

TIMEOUT = 0.5  # s, for an answer; the standard's T1 is 25 ms for a fast ECU, up to 2 s for a slow one
SHORTEST_TURN = 0.05  # s, of the ECU's stamps: receive stamps, which tell the turns, scatter by some ms
FIRST_OF_ANSWERS = 0xFC  # packet identifiers below are those of measurements

_ANSWER, _ERROR = 0xFF, 0xFE
_DAQ = 0x04  # bit of resources and of protected ones
_BIG_ENDIAN, _GRANULARITY = 0x01, 0x06  # bits of COMM_MODE_BASIC
_DYNAMIC, _HAS_STAMPS = 0x01, 0x10  # bits of DAQ_PROPERTIES
_IDENTIFICATION = 0xC0  # bits of DAQ_KEY_BYTE: 0 where the first byte of a packet alone says which it is
_STAMPED = 0x10  # bit of the mode of a list
_NO_BIT_OFFSET = 0xFF
_STAMP_SIZES = (1, 2, 4)
_STAMP_UNITS = (*(10.0**n for n in range(-9, 1)), 1e-12, 1e-11, 1e-10)  # s, by TIMESTAMP_UNIT
_ACCESS_LOCKED = 0x25


class XcpCommand(IntEnum):
    """Codes of the commands used."""

    CONNECT = 0xFF
    DISCONNECT = 0xFE
    GET_STATUS = 0xFD
    SET_DAQ_PTR = 0xE2
    WRITE_DAQ = 0xE1
    SET_DAQ_LIST_MODE = 0xE0
    START_STOP_DAQ_LIST = 0xDE
    START_STOP_SYNCH = 0xDD
    GET_DAQ_PROCESSOR_INFO = 0xDA
    GET_DAQ_RESOLUTION_INFO = 0xD9
    FREE_DAQ = 0xD6
    ALLOC_DAQ = 0xD5
    ALLOC_ODT = 0xD4
    ALLOC_ODT_ENTRY = 0xD3


@dataclass(frozen=True)
class Packets:
    """How the measurements of one event come: in packets numbered from `first`, stamped in the first of them.

    sizes: bytes of every measurement, packet by packet; stamp_size: bytes of the ECU's stamp, of `tick` [s].
    """

    first: int
    sizes: tuple[tuple[int, ...], ...]
    stamp_size: int
    tick: float
    is_big_endian: bool


def start_measuring(link: Link, config: XcpConfig) -> Packets:
    """Have the ECU send the measurements at every event.

    Raises:
        LinkDownError: the ECU does not answer (yet).
        RunError: it refuses, or cannot do what is needed.
    """
    return _Dialogue(link, config).start()


def stop_measuring(link: Link, config: XcpConfig) -> None:
    """Have the ECU send nothing more, and leave it. Raises as `start_measuring`."""
    dialogue = _Dialogue(link, config)
    dialogue.ask(XcpCommand.START_STOP_SYNCH, b"\0")
    dialogue.ask(XcpCommand.DISCONNECT)


class _Dialogue:
    """Commands and answers. order: of the ECU's bytes, as `struct` has it, known after CONNECT."""

    def __init__(self, link: Link, config: XcpConfig) -> None:
        self._link = link
        self._config = config
        self._order = "<"

    def start(self) -> Packets:
        longest = self._connect()
        stamp_size, tick = self._stamps()
        list_number = self._only_list()
        packets = _packets(self._config, longest, stamp_size)
        self._allocate(list_number, packets)
        mode = self._packed("BHHBB", _STAMPED, list_number, self._config.event, 1, 0)
        self.ask(XcpCommand.SET_DAQ_LIST_MODE, mode)
        first = self.ask(XcpCommand.START_STOP_DAQ_LIST, self._packed("BH", 2, list_number), 2)[1]
        self.ask(XcpCommand.START_STOP_SYNCH, b"\x01")
        sizes = tuple(tuple(DATA_TYPES[each.type].size for each in packet) for packet in packets)
        return Packets(first, sizes, stamp_size, tick, self._order == ">")

    def _connect(self) -> int:
        """Bytes of the longest packet with measurements."""
        answer = self.ask(XcpCommand.CONNECT, b"\0", 8)
        self._order = ">" if answer[2] & _BIG_ENDIAN else "<"
        if answer[2] & _GRANULARITY:
            raise self._cannot("address bytes one by one")
        if not answer[1] & _DAQ:
            raise self._cannot("send measurements by itself (DAQ)")
        if self.ask(XcpCommand.GET_STATUS, length=3)[2] & _DAQ:
            raise self._locked()
        return int(struct.unpack_from(f"{self._order}H", answer, 4)[0])

    def _stamps(self) -> tuple[int, float]:
        """Bytes of the ECU's stamps, and their unit [s]."""
        mode, ticks = struct.unpack_from(
            f"{self._order}BH", self.ask(XcpCommand.GET_DAQ_RESOLUTION_INFO, length=8), 5
        )
        size, unit = mode & 0x07, mode >> 4
        if size not in _STAMP_SIZES or unit >= len(_STAMP_UNITS):
            raise self._cannot("stamp its measurements")
        tick = ticks * _STAMP_UNITS[unit]
        if tick * (1 << 8 * size) < SHORTEST_TURN:
            raise self._cannot(
                f"stamp its measurements for {SHORTEST_TURN * 1e3:g} ms without beginning anew"
            )
        return size, tick

    def _only_list(self) -> int:
        """Number of the list that will be allocated: what was configured before is forgotten."""
        info = self.ask(XcpCommand.GET_DAQ_PROCESSOR_INFO, length=8)
        if not info[1] & _DYNAMIC:
            raise self._cannot("take a list of measurements (dynamic DAQ)")
        if not info[1] & _HAS_STAMPS:
            raise self._cannot("stamp its measurements")
        if info[7] & _IDENTIFICATION:
            raise self._cannot("number its packets in one byte (absolute ODT numbers)")
        self.ask(XcpCommand.START_STOP_SYNCH, b"\0")
        self.ask(XcpCommand.FREE_DAQ)
        self.ask(XcpCommand.ALLOC_DAQ, b"\0" + self._packed("H", 1))
        return info[6]

    def _allocate(self, list_number: int, packets: Sequence[Sequence[MeasurementConfig]]) -> None:
        self.ask(XcpCommand.ALLOC_ODT, b"\0" + self._packed("HB", list_number, len(packets)))
        for number, packet in enumerate(packets):
            self.ask(
                XcpCommand.ALLOC_ODT_ENTRY, b"\0" + self._packed("HBB", list_number, number, len(packet))
            )
        for number, packet in enumerate(packets):
            self.ask(XcpCommand.SET_DAQ_PTR, b"\0" + self._packed("HBB", list_number, number, 0))
            for each in packet:
                size = DATA_TYPES[each.type].size
                entry = self._packed("BBBI", _NO_BIT_OFFSET, size, each.extension, each.address)
                self.ask(XcpCommand.WRITE_DAQ, entry)

    def ask(self, command: XcpCommand, parameters: bytes = b"", length: int = 1) -> bytes:
        """The ECU's answer to a command, of this length at least."""
        config, link = self._config, self._link
        link.send(
            config.master_id, bytes([command]) + parameters, config.master_id > STANDARD_MASK, is_fd=False
        )
        end = time.monotonic() + TIMEOUT
        while (left := end - time.monotonic()) > 0.0:
            frame = link.receive(left)
            if frame is None or frame.frame_id != config.slave_id or not frame.payload:
                continue
            if frame.payload[0] == _ERROR and len(frame.payload) > 1:
                raise self._refused(command, frame.payload[1])
            if frame.payload[0] == _ANSWER and len(frame.payload) >= length:
                return frame.payload
        raise LinkDownError(
            f"the ECU at 0x{config.master_id:X} does not answer {command.name}\n"
            "  remedy: switch it on; check master_id, slave_id and the bit rates; end other tools that measure by XCP"
        )

    def _packed(self, layout: str, *values: int) -> bytes:
        return struct.pack(f"{self._order}{layout}", *values)

    def _refused(self, command: XcpCommand, code: int) -> RunError:
        if code == _ACCESS_LOCKED:
            return self._locked()
        return RunError(
            f"the ECU at 0x{self._config.master_id:X} refuses {command.name} with error 0x{code:02X}\n"
            "  remedy: compare event, addresses and types with the A2L file of the ECU's software"
        )

    def _locked(self) -> RunError:
        return self._cannot("measure unless unlocked by seed and key")

    def _cannot(self, what: str) -> RunError:
        return RunError(
            f"the ECU at 0x{self._config.master_id:X} cannot {what}\n"
            "  remedy: have the ECU, or the tool that measures it, send CAN frames by a DBC (docs/buses.md)"
        )


def _packets(config: XcpConfig, longest: int, stamp_size: int) -> list[list[MeasurementConfig]]:
    """Measurements in their order, as many in a packet as its bytes hold."""
    packets: list[list[MeasurementConfig]] = [[]]
    room = longest - 1 - stamp_size
    for each in config.measurements.values():
        size = DATA_TYPES[each.type].size
        if size > room:
            packets.append([])
            room = longest - 1
        packets[-1].append(each)
        room -= size
    if not packets[0]:
        raise RunError(
            f"the first measurement does not fit beside the ECU's stamp of {stamp_size} bytes\n"
            f"  remedy: name one of at most {longest - 1 - stamp_size} bytes first"
        )
    return packets
