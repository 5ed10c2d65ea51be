"""Pump from the links of a daemon through its core and back: a compiled loop in its own thread, fed by threads."""

import errno
import os
import select
import socket
import struct
import threading
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.can_frame import BIT_RATE_SWITCH, CLASSIC_MTU, EXTENDED_FLAG, FD_MTU, HEADER_BYTES
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.links.link import BusDownError, Link, LinkDownError
from observer_rt.bus.links.socketcan import SocketCanLink
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.core.frames.frames import ARRIVAL, ERROR_FRAME, ERRORS, PUMP, PUMP_BUS, WAIT_MS, WAITING, PumpLoop
from observer_rt.daemon.arrivals import Arrivals
from observer_rt.daemon.feeder import Feeder, Pace
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import OutputFrame, output_frame
from observer_rt.foundation.units import MICROSECOND, NANOSECOND, Ints, Structs

_TIMEVAL = struct.Struct("@ll")
SHORTEST = 1024  # ns, where the first of the octaves begins that are counted in quarters
QUANTILE = 0.999  # of the rates, that `Latency.p999` is about


class Pump(NamedTuple):
    """Memory that Python reads and writes beside the loop."""

    memory: Structs  # (1,) PUMP
    buses: Structs  # PUMP_BUS
    errors: Structs  # ERROR_FRAME, ERRORS of every bus
    arrivals: Structs  # ARRIVAL
    waiting: NDArray[np.uint8]  # WAITING results as the kernel takes them


def make_pump(buses: int, watched: Sequence[MessageLayout], result: MessageLayout | None) -> Pump:
    """Memory for so many buses; watched: messages whose arrivals are counted; result: that of the rates, if any."""
    arrivals = np.zeros(len(watched), ARRIVAL)
    arrivals["key"] = [layout.key for layout in watched]
    memory = np.zeros(1, PUMP)
    memory["bus"] = -1
    if result is not None:
        memory["bus"] = result.bus
        memory["identifier"] = result.frame_id | (EXTENDED_FLAG if result.is_extended else 0)
        memory["flags"] = BIT_RATE_SWITCH if result.is_fd else 0
        memory["size"] = FD_MTU if result.is_fd else CLASSIC_MTU
    waiting = np.zeros(WAITING * FD_MTU, np.uint8)
    return Pump(memory, np.zeros(buses, PUMP_BUS), np.zeros(buses * ERRORS, ERROR_FRAME), arrivals, waiting)


class Latency(NamedTuple):
    """Latency of all rates so far [s]: the 99.9 % quantile, to a quarter of an octave, and the largest."""

    p999: float
    largest: float

    def as_text(self) -> str:
        """Describes it in a few words."""
        p999, largest = (latency / MICROSECOND for latency in (self.p999, self.largest))
        return f"99.9 % of rates sent within {p999:.0f} us, the latest after {largest:.0f} us"


def latency_of(memory: np.void) -> Latency | None:
    """Latency by the counts of a `memory.PUMP`; None before rates were sent."""
    counts: Ints = memory["latencies"]
    total, largest = int(counts.sum()), int(memory["largest_latency"])
    if not total:
        return None
    bin_number = int(np.searchsorted(np.cumsum(counts), QUANTILE * total))
    octave, quarter = divmod(bin_number + 1, 4)
    end = SHORTEST * 2**octave * (1.0 + 0.25 * quarter) if bin_number + 1 < counts.size else largest
    return Latency(min(end, largest) * NANOSECOND, largest * NANOSECOND)


class FramePump:
    """Takes frames from links through a core and sends the rates they cause; buses are numbered as links.

    The loop runs until `close`, and asks Python through a descriptor. It reads raw sockets; a `Feeder` brings others.
    """

    def __init__(
        self,
        links: Sequence[Link],
        core: Core,
        bus_map: BusMap,
        arrivals: Arrivals,
        on_unsent: Callable[[int], None] = lambda count: None,
        on_thread: Callable[[], object] = lambda: None,
    ) -> None:
        """on_unsent: hears how many rates were given up; on_thread: called first by the loop's own."""
        self._links = links
        self._ends: dict[int, SocketCanLink] = {}  # what the loop reads and writes, by bus
        self._core = core
        self._fed = {number for number, link in enumerate(links) if not isinstance(link, SocketCanLink)}
        with_samples = {layout.bus for layout in bus_map.input_layouts}
        if self._fed & with_samples:  # then all that have, so that none gets ahead
            self._fed |= with_samples
        self._pace = Pace(core, bus_map, self._is_silent)
        self._arrivals = arrivals
        self._on_unsent = on_unsent
        self._on_thread = on_thread
        self._rate = bus_map.rate.layout if bus_map.rate else None
        self._pump = make_pump(len(links), arrivals.watched, self._rate)
        self._compiled = PumpLoop(*self._pump)
        self._errors_read = [0] * len(links)
        self._unsent = 0
        self._turns = -1
        self._left_out: set[int] = set()
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._closing = threading.Lock()
        self._is_closed = False
        core.call_when_learned(self._wake_server)
        self._readable = select.poll()
        self._readable.register(self._wake, select.POLLIN)
        self._waits, self._may_go_on = threading.Event(), threading.Event()
        self._failure: BaseException | None = None
        for number in range(len(links)):
            self.take_back(number)
        self._thread = threading.Thread(target=self._loop, name="pump")
        self._thread.start()

    def serve(self, timeout_s: float) -> Sequence[OutputFrame]:
        """Attend until something happened, or about `timeout_s`: frames for the caller to send.

        Raises `BusDownError` for a bus that went down: call `leave_out`, reconnect it, `take_back`; else `RunError`.
        """
        if self._readable.poll(1e3 * timeout_s):
            os.eventfd_read(self._wake)
        if self._failure is not None:
            raise self._failure
        self._take_counts()
        failure = self._bus_failure()
        if self._waits.is_set():
            frames = self._core.answer()
            self._waits.clear()
            self._may_go_on.set()
        else:
            frames = self._core.attend()
        if failure is not None and not frames:  # what came before it is reported first
            raise failure
        return frames

    def _wake_server(self) -> None:
        """Have `serve` attend at once; from another thread, which may outlive the pump."""
        with self._closing:
            if not self._is_closed:
                os.eventfd_write(self._wake, 1)

    def goes_round(self) -> bool:
        """Whether the loop, and all that feeds it, has done something since the last call."""
        before, self._turns = self._turns, int(self._pump.memory["turns"][0])
        goes = self._turns != before and all(feeder.goes_round() for feeder in self._feeders)
        return goes or self._waits.is_set()

    def latency(self) -> Latency | None:
        """Latency of the rates so far."""
        return latency_of(self._pump.memory[0])

    def leave_out(self, bus: int) -> None:
        """Neither receive from a bus nor send to it any more; results on their way to its link are given up."""
        self._left_out.add(bus)
        self._pump.buses[bus]["failure"] = errno.ENETDOWN
        if isinstance(end := self._ends[bus], Feeder) and (unsent := end.end()):
            self._on_unsent(len(unsent))

    def take_back(self, bus: int) -> None:
        """Serve a bus again, whose link was reconnected."""
        if isinstance(before := self._ends.get(bus), Feeder):
            before.close()
        link = self._links[bus]
        if bus in self._fed or not isinstance(link, SocketCanLink):
            link = Feeder(link, bus, partial(self._pace.is_ahead, bus))
        self._ends[bus] = link
        os.set_blocking(link.descriptor, True)  # wakes now and then for what Python has to say; sending never waits
        wait = _TIMEVAL.pack(0, WAIT_MS * 1000)
        with socket.socket(fileno=os.dup(link.descriptor)) as same:
            same.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, wait)
        state = self._pump.buses[bus]
        for name in PUMP_BUS.names or ():
            if name not in ("failure", "errors"):
                state[name] = 0
        state["fd"] = link.descriptor
        self._left_out.discard(bus)
        state["failure"] = 0  # last: from here on the loop uses it

    def sender(self, bus: int) -> Link:
        """Link by which results of a bus are to be sent, so that they come behind its rates."""
        end = self._ends[bus]
        return end if isinstance(end, Feeder) and not end.is_ended else self._links[bus]

    def finish(self) -> Sequence[OutputFrame]:
        """Ends the frames: returns results that wait for room, and complete ones, for the caller to send."""
        self._stop()
        self._take_counts()
        fed = [frame for feeder in self._feeders for frame in feeder.end()]
        return [*fed, *self._waiting_results(), *self._core.finish()]

    def close(self) -> None:
        """End what runs beside; the links stay open."""
        self._stop()
        for bus in self._ends:
            self.leave_out(bus)
        for feeder in self._feeders:
            feeder.close()
        with self._closing:
            self._is_closed = True
            os.close(self._wake)

    @property
    def _feeders(self) -> list[Feeder]:
        return [end for end in self._ends.values() if isinstance(end, Feeder)]

    def _is_silent(self, bus: int) -> bool:
        """Whether a fed bus has no frame on its way; a bus that is not served yet may have one."""
        end = self._ends.get(bus)
        return isinstance(end, Feeder) and end.is_silent

    def _loop(self) -> None:
        try:
            self._on_thread()
            while self._compiled.run(self._core.compiled, self._wake):
                self._may_go_on.clear()
                if self._pump.memory["is_to_stop"][0]:  # nobody answers any more
                    return
                self._waits.set()
                os.eventfd_write(self._wake, 1)
                self._may_go_on.wait()
        except BaseException as error:
            self._failure = error
            os.eventfd_write(self._wake, 1)

    def _stop(self) -> None:
        self._pump.memory["is_to_stop"] = True
        self._may_go_on.set()
        if self._thread.is_alive():
            self._thread.join()

    def _waiting_results(self) -> Iterator[OutputFrame]:
        """Rates that still waited for room: from now on the caller sends them."""
        memory, waiting = self._pump.memory[0], self._pump.waiting.reshape(-1, FD_MTU)
        while memory["first_waiting"] < memory["end_waiting"]:
            assert self._rate is not None
            frame = waiting[int(memory["first_waiting"]) % WAITING]
            memory["first_waiting"] += 1
            yield output_frame(self._rate, frame[HEADER_BYTES : HEADER_BYTES + int(frame[4])].tobytes())

    def _take_counts(self) -> None:
        """Takes over arrivals, error frames, lost frames and results given up, as the loop has counted them."""
        pump = self._pump
        for layout, arrival in zip(self._arrivals.watched, pump.arrivals, strict=True):
            self._arrivals.set_count(layout, int(arrival["frames"]), int(arrival["last"]))
        for number, link in self._ends.items():
            state = pump.buses[number]
            link.note_dropped(int(state["overflows"]))
            errors = int(state["errors"])
            for count in range(max(self._errors_read[number], errors - ERRORS), errors):
                error = pump.errors[number * ERRORS + count % ERRORS]
                link.note_error_frame(int(error["identifier"]), error["data"][: error["length"]].tobytes())
            self._errors_read[number] = errors
        unsent = int(pump.memory["unsent"][0])
        if unsent > self._unsent:
            self._on_unsent(unsent - self._unsent)
            self._unsent = unsent

    def _bus_failure(self) -> Exception | None:
        for number, end in self._ends.items():
            code = int(self._pump.buses[number]["failure"])
            if code != 0 and number not in self._left_out:
                failure = end.failure(OSError(code, os.strerror(code)))
                return BusDownError(number, failure) if isinstance(failure, LinkDownError) else failure
        return None
