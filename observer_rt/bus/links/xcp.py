"""An ECU that sends measurements by XCP on CAN, as a link whose frames carry a sample index and one sample of each.

Frames of other identifiers pass as they are.
"""

import time
from contextlib import suppress

from observer_rt.bus.links.link import (
    SWITCHED,
    BusCondition,
    FdFlags,
    Frame,
    Link,
    LinkDownError,
    StampSource,
)
from observer_rt.bus.links.xcp_dialogue import FIRST_OF_ANSWERS, Packets, start_measuring, stop_measuring
from observer_rt.config.xcp import XcpConfig
from observer_rt.foundation.errors import RunError

INDEX_BYTES = 4
SILENCE = 1.0  # s without measurements, after which the ECU is asked anew


class XcpLink(Link):
    """Measurements of one ECU by the link of its bus, which is closed with it."""

    def __init__(self, link: Link, config: XcpConfig) -> None:
        """link: receives `config.slave_id`. Raises as `start_measuring`; the link is closed then."""
        self._link = link
        self._config = config
        try:
            self._start()
        except BaseException:
            link.close()
            raise

    def _start(self) -> None:
        self._samples = _Samples(self._config, start_measuring(self._link, self._config))
        self._last = time.monotonic()

    def receive(self, timeout_s: float) -> Frame | None:
        end = time.monotonic() + timeout_s
        while (frame := self._link.receive(max(0.0, end - time.monotonic()))) is not None:
            if frame.frame_id != self._config.slave_id:
                self._require_measurements()
                return frame
            self._last = time.monotonic()
            if (sample := self._samples.after(frame)) is not None:
                return sample
        self._require_measurements()
        return None

    def _require_measurements(self) -> None:
        if time.monotonic() - self._last > SILENCE:
            raise LinkDownError(
                f"the ECU at 0x{self._config.master_id:X} sends no measurements any more\n"
                "  remedy: was it switched off, or is another tool measuring by XCP?"
            )

    def send(
        self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool, flags: FdFlags = SWITCHED
    ) -> None:
        self._link.send(frame_id, payload, is_extended, is_fd, flags)

    def try_send(self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool) -> bool:
        return self._link.try_send(frame_id, payload, is_extended, is_fd)

    def reconnect(self) -> None:
        self._link.reconnect()
        self._start()

    @property
    def dropped(self) -> int:
        return self._link.dropped

    @property
    def condition(self) -> BusCondition:
        return self._link.condition

    @property
    def stamp_source(self) -> StampSource:
        return self._link.stamp_source

    def close(self) -> None:
        with suppress(RunError):  # the ECU may be gone
            stop_measuring(self._link, self._config)
        self._link.close()


class _Samples:
    """Puts the packets of every event together, in the order of the bytes of this computer's messages."""

    def __init__(self, config: XcpConfig, packets: Packets) -> None:
        self._config = config
        self._packets = packets
        self._stamps = _EcuClock(packets.stamp_size, packets.tick)
        self._index = 0
        self._values = b""
        self._next = 0  # packet of the event that is being put together

    def after(self, frame: Frame) -> Frame | None:
        """The sample that this packet completes; None: there is none. An event that lacks one is left out."""
        payload, packets = frame.payload, self._packets
        if not payload or payload[0] >= FIRST_OF_ANSWERS:
            return None
        number, start = payload[0] - packets.first, 1
        if number == 0:
            start += packets.stamp_size
            stamp = int.from_bytes(payload[1:start], "big" if packets.is_big_endian else "little")
            since_first = self._stamps.seconds(stamp, frame.stamp_ns)
            self._index, self._values = round(since_first * self._config.rate_hz), b""
        elif number != self._next:
            self._next = 0
            return None
        self._values += self._own_order(payload, start, packets.sizes[number])
        self._next = (number + 1) % len(packets.sizes)
        if self._next:
            return None
        index = (self._index & 0xFFFF_FFFF).to_bytes(INDEX_BYTES, "little")
        return Frame(self._config.sample_id, index + self._values, frame.stamp_ns, is_extended=True)

    def _own_order(self, payload: bytes, start: int, sizes: tuple[int, ...]) -> bytes:
        """The values of a packet, little-endian."""
        if not self._packets.is_big_endian:
            return payload[start : start + sum(sizes)]
        values = b""
        for size in sizes:
            values += payload[start : start + size][::-1]
            start += size
        return values


class _EcuClock:
    """Time of the ECU from stamps that begin anew; how often they did in a gap the receive stamps tell."""

    def __init__(self, size: int, tick: float) -> None:
        self._modulus = 1 << 8 * size
        self._tick = tick
        self._ticks = 0
        self._last: tuple[int, int] | None = None  # stamp of the ECU, receive stamp [ns]

    def seconds(self, stamp: int, received_ns: int) -> float:
        """Time [s] since the first stamp: samples keep their distances whatever its fraction of a sample was."""
        if self._last is not None:
            ticks = (stamp - self._last[0]) % self._modulus
            elapsed = (received_ns - self._last[1]) * 1e-9 / self._tick
            self._ticks += ticks + self._modulus * max(0, round((elapsed - ticks) / self._modulus))
        self._last = stamp, received_ns
        return self._ticks * self._tick
