"""An ECU that answers XCP on CAN as the standard says, and measures: by python-can, for tests.

Written from the standard's tables of commands, with `tests/bus/links/test_xcp_peers.py` as the second opinion.
"""

import struct
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Self

import can

MASTER, SLAVE, EVENT = 0x7E0, 0x7E1, 3
RESULT, FAILED = 0xFF, 0xFE
UNKNOWN, LOCKED, SEQUENCE, RANGE = 0x20, 0x25, 0x29, 0x22


class RefusedError(Exception):
    """An answer with an error code."""


@dataclass
class Ecu:
    """memory: raw bytes of each address at the time of an event, in the ECU's order of bytes.

    order: of its bytes, "<" or ">"; max_dto: bytes of its longest packet; stamp_size, tick_us: of its stamps.
    """

    bus: can.BusABC
    memory: dict[int, bytes]
    order: str = "<"
    max_dto: int = 8
    stamp_size: int = 2
    tick_us: int = 10
    properties: int = 0x11  # dynamic lists, stamps
    is_locked: bool = False
    is_silent: bool = False
    commands: list[bytes] = field(default_factory=list)
    running: threading.Event = field(default_factory=threading.Event)

    def __post_init__(self) -> None:
        self._odts: list[list[tuple[int, int]]] = []  # (address, size) of each entry
        self._pointer = (0, 0)
        self._selected = False
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="ECU", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    def happen(self, ticks: int, memory: Mapping[int, bytes] | None = None) -> None:
        """One event: send what was asked for, stamped; as fast as the bus takes it."""
        memory = self.memory if memory is None else memory
        stamp = (ticks % (1 << 8 * self.stamp_size)).to_bytes(
            self.stamp_size, "little" if self.order == "<" else "big"
        )
        for number, entries in enumerate(self._odts):
            values = b"".join(memory[address][:size] for address, size in entries)
            self._send(bytes([number]) + (stamp if number == 0 else b"") + values)

    def _serve(self) -> None:
        while not self._end.is_set():
            message = self.bus.recv(0.02)
            if message is None or message.arbitration_id != MASTER or self.is_silent:
                continue
            request = bytes(message.data)
            self.commands.append(request)
            try:
                answer = bytes([RESULT]) + self._answers().get(request[0], self._unknown)(request)
            except RefusedError as refusal:
                answer = bytes([FAILED, refusal.args[0]])
            self._send(answer)

    def _answers(self) -> Mapping[int, Callable[[bytes], bytes]]:
        return {
            0xFF: self._connect,
            0xFE: lambda _: b"",
            0xFD: lambda _: bytes([0, 0x04 if self.is_locked else 0, 0, 0, 0]),
            0xFB: lambda _: bytes([0, 0, 0, 0, 0, 0x10, 0]),
            0xDA: lambda _: self._packed("BHHBB", self.properties, 0, 8, 0, 0),
            0xD9: lambda _: self._packed(
                "BBBBBH", 1, 8, 1, 8, self.stamp_size | 0x30, self.tick_us
            ),  # 0x30: microseconds
            0xD6: self._free,
            0xD5: self._allocate_lists,
            0xD4: self._allocate_odts,
            0xD3: self._allocate_entries,
            0xE2: self._point,
            0xE1: self._write,
            0xE0: self._set_mode,
            0xDE: self._select,
            0xDD: self._synchronise,
        }

    def _unknown(self, _: bytes) -> bytes:
        raise RefusedError(UNKNOWN)

    def _connect(self, _: bytes) -> bytes:
        mode = 0 if self.order == "<" else 1
        return self._packed("BBBHBB", 0x04, mode, 8, self.max_dto, 1, 1)

    def _free(self, _: bytes) -> bytes:
        self._odts = []
        self.running.clear()
        return b""

    def _allocate_lists(self, request: bytes) -> bytes:
        self._require(self._read("H", request, 2) == (1,), RANGE)
        return b""

    def _allocate_odts(self, request: bytes) -> bytes:
        number, count = self._read("HB", request, 2)
        self._require(number == 0 and not self._odts, SEQUENCE)
        self._odts = [[] for _ in range(count)]
        self._sizes = [0] * count
        return b""

    def _allocate_entries(self, request: bytes) -> bytes:
        _, odt, count = self._read("HBB", request, 2)
        self._require(count > 0 and odt < len(self._odts), RANGE)
        self._sizes[odt] = count
        return b""

    def _point(self, request: bytes) -> bytes:
        _, odt, entry = self._read("HBB", request, 2)
        self._require(entry < self._sizes[odt], RANGE)
        self._pointer = odt, entry
        return b""

    def _write(self, request: bytes) -> bytes:
        _, size, _, address = self._read("BBBI", request, 1)
        odt, entry = self._pointer
        self._require(address in self.memory and len(self.memory[address]) == size, RANGE)
        self._require(entry < self._sizes[odt] and entry == len(self._odts[odt]), SEQUENCE)
        self._odts[odt].append((address, size))
        taken = 1 + (self.stamp_size if odt == 0 else 0) + sum(size for _, size in self._odts[odt])
        self._require(taken <= self.max_dto, RANGE)
        self._pointer = odt, entry + 1
        return b""

    def _set_mode(self, request: bytes) -> bytes:
        mode, _, event, prescaler, _ = self._read("BHHBB", request, 1)
        self._require(mode & 0x10 and event == EVENT and prescaler == 1, RANGE)
        return b""

    def _select(self, request: bytes) -> bytes:
        self._selected = request[1] == 2
        return b"\0"  # identifier of its first packet

    def _synchronise(self, request: bytes) -> bytes:
        if request[1] == 1:
            self._require(self._selected, SEQUENCE)
            self.running.set()
        else:
            self.running.clear()
        return b""

    def _require(self, condition: object, code: int) -> None:
        if not condition:
            raise RefusedError(code)

    def _packed(self, layout: str, *values: int) -> bytes:
        return struct.pack(f"{self.order}{layout}", *values)

    def _read(self, layout: str, request: bytes, start: int) -> tuple[int, ...]:
        return struct.unpack_from(f"{self.order}{layout}", request, start)

    def _send(self, payload: bytes) -> None:
        is_fd = len(payload) > 8
        lengths = (*range(9), 12, 16, 20, 24, 32, 48, 64)
        padded = payload.ljust(next(n for n in lengths if n >= len(payload)), b"\0")
        self.bus.send(
            can.Message(arbitration_id=SLAVE, data=padded, is_extended_id=False, is_fd=is_fd), timeout=1.0
        )


def wait_until_measuring(ecu: Ecu, patience: float = 60.0) -> None:
    """Until it was asked to send."""
    assert ecu.running.wait(patience), "nobody asked the ECU to measure"
    time.sleep(0.01)
