"""Any link as a descriptor that the compiled loop reads and writes: threads of Python carry frames between them."""

import socket
import struct
import threading
import time
from collections.abc import Callable

from observer_rt.bus.can_frame import EXTENDED_FLAG, EXTENDED_MASK, FD_MTU, HEADER_BYTES
from observer_rt.bus.links.descriptor import DescriptorLink
from observer_rt.bus.links.link import Link
from observer_rt.bus.links.receiver import LONGEST_WAIT
from observer_rt.bus.mapping.bus_map import BusMap, layout_of
from observer_rt.bus.mapping.timing import SLOTS
from observer_rt.service.core.core import Core
from observer_rt.service.core.messages import OutputFrame
from observer_rt.service.port import RETRY

ROOM = 1 << 14  # bytes: some twenty frames; more wait in the driver
RESULTS_ROOM = 1 << 17  # bytes: some 170; rates of more wait in the loop, which gives up the oldest
FAR = SLOTS // 4  # samples, of those that may wait for another message
PAUSE = 0.05  # s without a new sample, after which nothing waits for a message any more
_STAMPED = struct.Struct("=IBB2x64sq")  # struct canfd_frame, its stamp behind it [ns]


class Pace:
    """Keeps fed buses abreast: stamps by arrival do not tell the order of frames that waited in several drivers."""

    def __init__(self, core: Core, bus: BusMap) -> None:
        self._core = core
        self._buses = [layout_of(bus, stream).bus for stream in range(len(bus.inputs.streams))]
        self._are_several = len(set(self._buses)) > 1
        self._reached = [(-1, 0.0)] * len(self._buses)  # by stream: sample index, and since when [s]

    def is_ahead(self, bus: int) -> bool:
        """Whether a bus is so far ahead of another that its next frame is to wait."""
        if not self._are_several:
            return False
        now = time.monotonic()
        for stream, index in enumerate(self._core.progress):
            if index != self._reached[stream][0]:
                self._reached[stream] = index, now
        streams = list(zip(self._buses, self._reached, strict=True))
        own = max((index for of, (index, _) in streams if of == bus), default=-1)
        return any(
            FAR < own - index < SLOTS and now - since < PAUSE for of, (index, since) in streams if of != bus
        )


class Feeder(DescriptorLink):
    """The loop's end of a pair of sockets, and two threads at the other: frames of a link come, results go to it.

    `try_send` puts other results behind the rates that the loop sends.
    """

    def __init__(self, link: Link, bus: int, is_ahead: Callable[[], bool]) -> None:
        """bus: its number; is_ahead: whether the frame that came is to wait."""
        ours, self._other_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with ours:
            ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, RESULTS_ROOM)
            self._other_end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, ROOM)
            super().__init__(str(ours.fileno()), True, [])
        self._link = link
        self._bus = bus
        self._is_ahead = is_ahead
        self._error: Exception | None = None
        self._unsent: list[OutputFrame] = []
        self._has_answered = False
        self._ended = threading.Event()
        self._threads = [threading.Thread(target=each, daemon=True) for each in (self._bring, self._send_on)]
        for thread in self._threads:
            thread.start()

    def failure(self, error: OSError) -> Exception:
        """What ended the carrying, if it was the link."""
        return self._error or super().failure(error)

    def goes_round(self) -> bool:
        """Whether the link has come back from receiving since the last call, or need not any more."""
        answered, self._has_answered = self._has_answered, self._ended.is_set()
        return answered

    @property
    def is_ended(self) -> bool:
        """Whether nothing is carried any more."""
        return self._ended.is_set()

    def end(self) -> list[OutputFrame]:
        """Carry nothing any more: the results that were not sent, in order, each told once."""
        self._ended.set()
        self._socket.shutdown(socket.SHUT_RDWR)  # wakes both threads, and refuses what is sent late
        for thread in self._threads:
            thread.join()
        unsent, self._unsent = self._unsent, []
        return unsent

    def close(self) -> None:
        self.end()
        super().close()
        self._other_end.close()

    def _bring(self) -> None:
        """Frames from the link to the loop."""
        try:
            while not self._ended.is_set():
                frame = self._link.receive(LONGEST_WAIT)
                self._has_answered = True
                if frame is None:
                    continue
                while self._is_ahead() and not self._ended.is_set():
                    time.sleep(RETRY)
                identifier = frame.frame_id | EXTENDED_FLAG * frame.is_extended
                length = len(frame.payload)
                self._other_end.send(_STAMPED.pack(identifier, length, 0, frame.payload, frame.stamp_ns))
        except Exception as error:  # whatever it is, the pump must hear of it
            self._fail(error)

    def _send_on(self) -> None:
        """Results to the link, until the last; those that come too late are kept."""
        while data := self._other_end.recv(FD_MTU):
            identifier, length = struct.unpack_from("=IB", data)
            is_extended, is_fd = bool(identifier & EXTENDED_FLAG), len(data) == FD_MTU
            payload = data[HEADER_BYTES : HEADER_BYTES + length]
            frame = OutputFrame(identifier & EXTENDED_MASK, is_extended, is_fd, payload, self._bus)
            while not self._ended.is_set():
                if self._is_sent(frame):
                    break
                time.sleep(RETRY)
            else:
                self._unsent.append(frame)

    def _is_sent(self, frame: OutputFrame) -> bool:
        try:
            return self._link.try_send(frame.frame_id, frame.payload, frame.is_extended, frame.is_fd)
        except Exception as error:
            self._fail(error)
            return False

    def _fail(self, error: Exception) -> None:
        """End, and let the loop see it behind the frames that wait."""
        if not self._ended.is_set():
            self._error = error
            self._ended.set()
            self._other_end.shutdown(socket.SHUT_WR)
