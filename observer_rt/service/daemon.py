"""The daemon: a thin loop round the core, from a link back onto it."""

import gc
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from observer_rt.bus.database import database_hash
from observer_rt.bus.link import Link
from observer_rt.bus.mapping import BusMap
from observer_rt.config import Bench
from observer_rt.observer.knowledge import Knowledge
from observer_rt.observer.state import Reason, State
from observer_rt.service.core import Core
from observer_rt.service.output import FrameWriter, OutputFrame
from observer_rt.service.report import InjectionReport
from observer_rt.service.state_file import model_hash
from observer_rt.service.status import status_values

RECEIVE_TIMEOUT = 0.02  # s, after which the loop looks at its clock and its stop signal
INPUT_TIMEOUT = 0.5  # s without an input frame: waiting for data


class Daemon:
    """Observes what comes in on a link until told to stop."""

    def __init__(
        self,
        bench: Bench,
        bus: BusMap,
        link: Link,
        knowledge: Knowledge | None = None,
        on_report: Callable[[InjectionReport], None] | None = None,
    ) -> None:
        """knowledge: restored from an earlier run; on_report is called from the loop with every injection."""
        self._link = link
        self._executor = ThreadPoolExecutor(1, thread_name_prefix="learning")
        self._bench = bench
        self.core = Core(bench, bus, knowledge, self._executor, on_report=on_report)
        self._status_writer = FrameWriter(bus.status)
        self._status_period = round(bench.config.outputs.status_period_ms * 1e6)
        self._hashes = (int(model_hash(bench.injector)[:8], 16), database_hash(bench.databases))
        self._frames_seen = 0
        self._last_input = 0
        self.ready = threading.Event()

    def run(self, stop: threading.Event) -> None:
        """Serve until `stop` is set, then publish what is complete and a last status frame.

        Call `warm_up` before the link is opened: what is not compiled yet would be compiled while frames come in.
        Raises `RunError` when the link fails.
        """
        gc.collect()
        gc.freeze()  # a full collection would stop the loop for tens of milliseconds
        self._last_input = next_status = time.monotonic_ns()
        self.ready.set()
        try:
            while not stop.is_set():
                frame = self._link.receive(RECEIVE_TIMEOUT)
                now = time.monotonic_ns()
                if frame is not None:
                    self._send(
                        self.core.handle(frame.frame_id, frame.is_extended, frame.payload, frame.stamp_ns)
                    )
                if now >= next_status:
                    self._send_status(now)
                    next_status = now + self._status_period
            self._send(self.core.finish())
            self._send_status(time.monotonic_ns())
        finally:
            self._executor.shutdown(cancel_futures=True)
            gc.unfreeze()

    def state(self, now: int) -> tuple[State, Reason]:
        """State and reason at a monotonic time [ns], inputs that stay away included."""
        frames = self.core.counters.frames
        if frames != self._frames_seen:
            self._frames_seen = frames
            self._last_input = now
        if frames == 0:
            return State.WAITING_FOR_DATA, Reason.STARTING
        if now - self._last_input > INPUT_TIMEOUT * 1e9:
            return State.WAITING_FOR_DATA, Reason.INPUT_TIMEOUT
        return self.core.state

    @property
    def dropped(self) -> int:
        """Frames lost before they reached the loop."""
        return self._link.dropped

    def _send(self, frames: list[OutputFrame]) -> None:
        for frame in frames:
            self._link.send(frame.frame_id, frame.payload, frame.is_extended, frame.is_fd)

    def _send_status(self, now: int) -> None:
        state, reason = self.state(now)
        values = status_values(
            self.core, state, reason, self._bench.config.outputs.injector_id, self._hashes, self._link.dropped
        )
        self._send(self._status_writer.write(values))
