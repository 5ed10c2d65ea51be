"""The pump for whatever interface python-can knows: Python takes each frame from its link to the core."""

import time
from collections.abc import Sequence

from observer_rt.bus.links.link import Link
from observer_rt.bus.links.receiver import reading
from observer_rt.service.core.core import Core
from observer_rt.service.core.messages import OutputFrame
from observer_rt.service.pump.pump import FramePump
from observer_rt.service.watch.arrivals import Arrivals


class PythonPump(FramePump):
    """One frame a turn, in the caller's thread."""

    def __init__(self, links: Sequence[Link], core: Core, arrivals: Arrivals) -> None:
        self._core = core
        self._arrivals = arrivals
        self._reading = reading(links, core.furthest_behind)

    def serve(self, timeout_s: float) -> Sequence[OutputFrame]:
        received = self._reading.receive(timeout_s)
        if received is None:
            self._core.attend()
            return ()
        bus, frame = received
        self._arrivals.note(bus, frame.frame_id, frame.is_extended, time.monotonic_ns())
        return self._core.handle(frame.frame_id, frame.is_extended, frame.payload, frame.stamp_ns, bus)

    def leave_out(self, bus: int) -> None:
        self._reading.leave_out(bus)

    def take_back(self, bus: int) -> None:
        self._reading.take_back(bus)

    def finish(self) -> Sequence[OutputFrame]:
        return self._core.finish()

    def close(self) -> None:
        self._reading.close()
