"""The pump for SocketCAN: compiled code in a thread of its own, which Python only attends to."""

import os
import select
import socket
import struct
import threading
from collections.abc import Callable, Iterator, Sequence

from observer_rt.bus.can_frame import FD_MTU, HEADER_BYTES
from observer_rt.bus.j1939 import GroupIdentifier
from observer_rt.bus.links.link import Link, LinkDownError
from observer_rt.bus.links.receiver import BusDownError
from observer_rt.bus.links.socketcan import SocketCanLink
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench import Bench
from observer_rt.service.compiled.asking import Need
from observer_rt.service.core.core import Core
from observer_rt.service.core.messages import OutputFrame, output_frame
from observer_rt.service.pump import libc, loop
from observer_rt.service.pump.memory import BATCH, BUS, ERRORS, WAITING, make_pump
from observer_rt.service.pump.pump import FramePump
from observer_rt.service.rights import hurry
from observer_rt.service.watch.arrivals import Arrivals

BUSY_WAIT = 2e-3  # s between two looks while events wait to be judged
_RAW = ("socketcan", "descriptor")  # interfaces
_TIMEVAL = struct.Struct("@ll")


def is_pumped(bench: Bench, bus: BusMap) -> bool:
    """Whether the daemon of a bench will use the compiled pump."""
    return can_pump_messages(bus) and all(link.config.interface in _RAW for link in bench.config.buses)


def can_pump(links: Sequence[Link], bus: BusMap) -> bool:
    """Whether the compiled pump can serve these links."""
    return can_pump_messages(bus) and all(isinstance(link, SocketCanLink) for link in links)


def can_pump_messages(bus: BusMap) -> bool:
    """No J1939, where identifiers change with the sender."""
    return not any(isinstance(each.received_id, GroupIdentifier) for each in bus.received)


class CompiledPump(FramePump):
    """The loop runs until `close`; what it needs of Python it asks for through a descriptor."""

    def __init__(
        self,
        links: Sequence[Link],
        core: Core,
        bus: BusMap,
        arrivals: Arrivals,
        on_unsent: Callable[[int], None] = lambda count: None,
        processor: int | None = None,
    ) -> None:
        """on_unsent: hears how many rates were given up, now and then; processor: that the loop is to stay on."""
        self._links = [link for link in links if isinstance(link, SocketCanLink)]
        self._core = core
        self._arrivals = arrivals
        self._on_unsent = on_unsent
        self._processor = processor
        self._layouts = (*bus.received, *bus.sent)
        self._rate = bus.rate.layout if bus.rate else None
        self._pump = make_pump(len(links), self._layouts, core.asking, self._rate)
        self._compiled = loop.compiled_for(self._pump, core.compiled.held)
        self._errors_read = [0] * len(links)
        self._unsent = 0
        self._turns = -1
        self._left_out: set[int] = set()
        self._wake = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._readable = select.poll()
        self._readable.register(self._wake, select.POLLIN)
        self._waits, self._may_go_on = threading.Event(), threading.Event()
        self._inputs = threading.Lock()  # of the core: the loop's thread takes them, too
        self._failure: BaseException | None = None
        for number in range(len(links)):
            self.take_back(number)
        self._thread = threading.Thread(target=self._loop, name="pump")
        self._thread.start()

    def serve(self, timeout_s: float) -> Sequence[OutputFrame]:
        wait = timeout_s if self._core.is_idle else min(timeout_s, BUSY_WAIT)
        if self._readable.poll(1e3 * wait):
            os.eventfd_read(self._wake)
        if self._failure is not None:
            raise self._failure
        self._note_what_came()
        for number, link in enumerate(self._links):
            self._refuse_failure(number, link)
        with self._inputs:
            if not self._waits.is_set():
                return self._core.attend()
            frames = self._core.answer()
        self._waits.clear()
        self._may_go_on.set()
        return frames

    def goes_round(self) -> bool:
        before, self._turns = self._turns, int(self._pump.memory["turns"][0])
        return self._turns != before or self._waits.is_set()

    def leave_out(self, bus: int) -> None:
        self._left_out.add(bus)
        self._pump.buses[bus]["failure"] = libc.ENETDOWN

    def take_back(self, bus: int) -> None:
        link = self._links[bus]
        # wakes now and then for what Python has to say; sending never waits
        os.set_blocking(link.descriptor, True)
        wait = _TIMEVAL.pack(0, loop.WAIT_MS * 1000)
        with socket.socket(fileno=os.dup(link.descriptor)) as same:
            same.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, wait)
        state = self._pump.buses[bus]
        for name in BUS.names or ():
            if name not in ("failure", "errors"):
                state[name] = 0
        state["fd"] = link.descriptor
        self._left_out.discard(bus)
        state["failure"] = 0  # last: from here on the loop uses it

    def finish(self) -> Sequence[OutputFrame]:
        self._stop()
        self._note_what_came()
        return [*self._waiting_rates(), *self._core.finish()]

    def close(self) -> None:
        self._stop()
        os.close(self._wake)

    def _loop(self) -> None:
        """The thread of the compiled loop; Python runs in it only for what the loop needs of it."""
        try:
            hurry(self._processor)
            while need := Need(self._compiled(self._pump, self._core.compiled.held, self._wake)):
                if need is Need.INPUT:
                    self._take_input()
                    continue
                self._may_go_on.clear()
                if self._pump.memory["is_to_stop"][0]:  # nobody answers any more
                    return
                self._waits.set()
                os.eventfd_write(self._wake, 1)
                self._may_go_on.wait()
        except BaseException as error:
            self._failure = error
            os.eventfd_write(self._wake, 1)

    def _take_input(self) -> None:
        """Let the core look at its optional inputs before the next frame."""
        pump, memory = self._pump, self._pump.memory[0]
        number = int(memory["asked_bus"])
        bus = pump.buses[number]
        at = (number * BATCH + int(bus["next"])) * FD_MTU
        data = pump.frames[at + HEADER_BYTES : at + HEADER_BYTES + int(pump.frames[at + 4])]
        with self._inputs:
            self._core.take_inputs(int(memory["asked_key"]), data, int(bus["stamp"]))

    def _stop(self) -> None:
        self._pump.memory["is_to_stop"] = True
        self._may_go_on.set()
        if self._thread.is_alive():
            self._thread.join()

    def _waiting_rates(self) -> Iterator[OutputFrame]:
        """Those for which there was no room yet: they are the caller's now."""
        memory, waiting = self._pump.memory[0], self._pump.waiting.reshape(-1, FD_MTU)
        while memory["first_waiting"] < memory["end_waiting"]:
            assert self._rate is not None
            frame = waiting[int(memory["first_waiting"]) % WAITING]
            memory["first_waiting"] += 1
            yield output_frame(self._rate, frame[HEADER_BYTES : HEADER_BYTES + int(frame[4])].tobytes())

    def _note_what_came(self) -> None:
        """Arrivals, error frames, lost frames and results given up, as the loop has counted them."""
        pump = self._pump
        for layout, arrival in zip(self._layouts, pump.arrivals, strict=True):
            self._arrivals.set(layout, int(arrival["frames"]), int(arrival["last"]))
        for number, link in enumerate(self._links):
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

    def _refuse_failure(self, number: int, link: SocketCanLink) -> None:
        """Raise what the loop met on a bus."""
        code = int(self._pump.buses[number]["failure"])
        if code == 0 or number in self._left_out:
            return
        failure = link.failure(OSError(code, os.strerror(code)))
        if isinstance(failure, LinkDownError):
            raise BusDownError(number, failure)
        raise failure
