"""Feeder of the compiled loop: brings it the frames of links that are no raw sockets, the buses abreast."""

import socket
import struct
import threading
import time
from collections.abc import Callable

from observer_rt.bus.can_frame import EXTENDED_FLAG, EXTENDED_MASK, FD_MTU, HEADER_BYTES
from observer_rt.bus.links.descriptor import DescriptorLink
from observer_rt.bus.links.link import LONGEST_WAIT, Link
from observer_rt.bus.mapping.bus_map import BusMap, layout_of
from observer_rt.core.frames.frames import SLOTS as SAMPLE_SLOTS
from observer_rt.daemon.port import RETRY
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import OutputFrame

ROOM = 1 << 14  # bytes: some twenty frames; more wait in the driver
RESULTS_ROOM = 1 << 17  # bytes: some 170; rates of more wait in the loop, which gives up the oldest
FAR_AHEAD = SAMPLE_SLOTS // 4  # samples, of those that may wait for another message
PAUSE = 0.5  # s without a new sample, after which nothing waits for a message any more, whatever else its bus brings
NO_INDEX = -2  # instead of the sample index of a stream
_STAMPED = struct.Struct("=IBB2x64sq")  # struct canfd_frame, its stamp behind it [ns]


class Pace:
    """Keeps fed buses abreast: stamps by arrival do not tell the order of frames that waited in several drivers."""

    def __init__(self, core: Core, bus_map: BusMap, is_silent: Callable[[int], bool]) -> None:
        """is_silent: no frame of a bus is on its way, which then holds up no other."""
        self._core = core
        self._buses = [layout_of(bus_map, stream).bus for stream in range(len(bus_map.inputs.streams))]
        self._are_several = len(set(self._buses)) > 1
        self._is_silent = is_silent
        self._reached = [(NO_INDEX, 0.0)] * len(self._buses)  # by stream: sample index, and since when [s]

    def is_ahead(self, bus: int) -> bool:
        """Whether a bus is so far ahead of another that its next frame is to wait."""
        if not self._are_several:
            return False
        now = time.monotonic()
        for stream, index in enumerate(self._core.progress):
            if index != self._reached[stream][0]:
                self._reached[stream] = index, now
        streams = list(zip(self._buses, self._reached, strict=True))
        start = -1  # at which streams that have not begun will begin, as far as the others tell
        if any(index < 0 for _, (index, _) in streams):
            start = min((index for index in self._core.begun_at if index >= 0), default=-1)
        own = max((index for of, (index, _) in streams if of == bus), default=-1)
        return any(
            FAR_AHEAD < own - max(index, start) < SAMPLE_SLOTS and now - since < PAUSE and not self._is_silent(of)
            for of, (index, since) in streams
            if of != bus
        )


class Feeder(DescriptorLink):
    """The loop's end of a socket pair; two threads at the other move frames in and results out, behind rates."""

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
        self._is_empty = False
        self._ended = threading.Event()
        targets = self._receive_frames, self._send_results
        self._threads = [threading.Thread(target=target, daemon=True) for target in targets]
        for thread in self._threads:
            thread.start()

    def failure(self, error: OSError) -> Exception:
        """Failure that ended the carrying, if it was the link."""
        return self._error or super().failure(error)

    def goes_round(self) -> bool:
        """Whether the link has come back from receiving since the last call, or need not any more."""
        answered, self._has_answered = self._has_answered, self._ended.is_set()
        return answered

    @property
    def is_silent(self) -> bool:
        """Whether no frame is on its way: the link had none when it was asked last."""
        return self._is_empty or self.is_ended

    @property
    def is_ended(self) -> bool:
        """Whether both threads have stopped carrying frames, or are about to."""
        return self._ended.is_set()

    def end(self) -> list[OutputFrame]:
        """Stop both threads; returns the results that were not sent, in order, each at one call only."""
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

    def _receive_frames(self) -> None:
        try:
            while not self._ended.is_set():
                frame = self._link.receive(LONGEST_WAIT)
                self._has_answered, self._is_empty = True, frame is None
                if frame is None:
                    continue
                while self._is_ahead() and not self._ended.is_set():
                    time.sleep(RETRY)
                identifier = frame.frame_id | EXTENDED_FLAG * frame.is_extended
                self._other_end.send(_STAMPED.pack(identifier, len(frame.payload), 0, frame.payload, frame.stamp_ns))
        except Exception as error:  # whatever it is, the pump must hear of it
            self._fail(error)

    def _send_results(self) -> None:
        """Sends results to the link, until the last; those left over are for `end` to return."""
        while data := self._other_end.recv(FD_MTU):
            identifier, length = struct.unpack_from("=IB", data)
            is_extended, is_fd = bool(identifier & EXTENDED_FLAG), len(data) == FD_MTU
            payload = data[HEADER_BYTES : HEADER_BYTES + length]
            frame = OutputFrame(identifier & EXTENDED_MASK, is_extended, is_fd, payload, self._bus)
            while not self._ended.is_set():
                try:
                    if self._link.try_send(frame.frame_id, frame.payload, frame.is_extended, frame.is_fd):
                        break
                except Exception as error:
                    self._fail(error)
                time.sleep(RETRY)
            else:
                self._unsent.append(frame)

    def _fail(self, error: Exception) -> None:
        """End, and let the loop see it behind the frames that wait."""
        if not self._ended.is_set():
            self._error = error
            self._ended.set()
            self._other_end.shutdown(socket.SHUT_WR)
