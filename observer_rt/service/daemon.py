"""The daemon: a thin loop round the core, from a link back onto it."""

import contextlib
import gc
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from observer_rt.bus.database import database_hash
from observer_rt.bus.link import Link, LinkDownError
from observer_rt.bus.mapping import BusMap
from observer_rt.config import Bench
from observer_rt.observer.knowledge import Knowledge
from observer_rt.observer.state import Reason, State
from observer_rt.service.core import Core
from observer_rt.service.energizing import Mismatch
from observer_rt.service.link_watch import LinkWatch
from observer_rt.service.measured_mass import MeasuredMass
from observer_rt.service.outbox import RETRY, Outbox
from observer_rt.service.output import FrameWriter, OutputFrame
from observer_rt.service.report import InjectionReport
from observer_rt.service.state_file import model_hash
from observer_rt.service.status import LinkFigures, status_values

RECEIVE_TIMEOUT = 0.02  # s, after which the loop looks at its clock and its stop signal
INPUT_TIMEOUT = 0.5  # s without an input frame: waiting for data
RECONNECT_PERIOD = 0.1  # s between tries while the interface is down or away
SILENCE = 10.0  # s without an outage, after which the same one is told again: some devices come and go
LAST_FRAMES = 0.5  # s for the last results to be sent in


class Daemon:
    """Observes what comes in on a link until told to stop."""

    def __init__(
        self,
        bench: Bench,
        bus: BusMap,
        link: Link,
        knowledge: Knowledge | None = None,
        on_report: Callable[[InjectionReport], None] | None = None,
        on_message: Callable[[str], None] | None = None,
        on_measured: Callable[[MeasuredMass], None] | None = None,
        on_mismatch: Callable[[Mismatch], None] | None = None,
    ) -> None:
        """knowledge: restored from an earlier run.

        on_report is called from the loop with every injection, on_measured with those whose mass was measured,
        on_mismatch with those missing after a command or without one, on_message with what goes wrong on the link.
        """
        self.link = link
        self._outbox = Outbox(link)
        self._channel = bench.config.link.channel
        self._watch = LinkWatch(self._channel, link, self._outbox)
        self._on_message = on_message or (lambda _: None)
        self._outages = 0
        self._last_outage = ("", -SILENCE)  # what was the matter, and when
        self._executor = ThreadPoolExecutor(1, thread_name_prefix="learning")
        self._bench = bench
        listeners = on_report, on_measured, on_mismatch
        self.core = Core(bench, bus, knowledge, self._executor, None, *listeners)
        self._status_writer = FrameWriter(bus.status)
        self._status_period = round(bench.config.outputs.status_period_ms * 1e6)
        self._hashes = (int(model_hash(bench.injector)[:8], 16), database_hash(bench.databases))
        self._frames_seen = 0
        self._last_input = 0
        self.ready = threading.Event()

    def run(self, stop: threading.Event) -> None:
        """Serve until `stop` is set, then publish what is complete and a last status frame.

        An interface that goes down or away is waited for. Call `warm_up` before the link is opened: what is not
        compiled yet would be compiled while frames come in. Raises `RunError` when the link fails otherwise.
        """
        gc.collect()
        gc.freeze()  # a full collection would stop the loop for tens of milliseconds
        self._last_input = self._next_status = time.monotonic_ns()
        self.ready.set()
        try:
            while not stop.is_set():
                try:
                    self._serve_once()
                except LinkDownError as error:
                    self._await_link(error, stop)
            self._finish()
        finally:
            self._executor.shutdown(cancel_futures=True)
            gc.unfreeze()

    def _serve_once(self) -> None:
        """One frame, or none within the time-out; results, and status when it is due."""
        frame = self.link.receive(RETRY if self._outbox else RECEIVE_TIMEOUT)
        now = time.monotonic_ns()
        if frame is not None:
            self._outbox.post(
                self.core.handle(frame.frame_id, frame.is_extended, frame.payload, frame.stamp_ns)
            )
        elif self._outbox:
            self._outbox.flush()
        if now >= self._next_status:
            self._next_status = now + self._status_period
            self._outbox.post(self._status(now))
            for message in self._watch.messages(now):
                self._on_message(message)

    def _await_link(self, error: LinkDownError, stop: threading.Event) -> None:
        """Until the interface is back or `stop` is set; says why it waits."""
        self._outages += 1
        self._frames_seen, self._last_input = self.core.counters.frames, 0  # what came before is past
        self._outbox.discard()  # by then they would be too old for anybody
        told = False
        while not stop.is_set():
            told = self._tell_outage(str(error)) or told
            stop.wait(RECONNECT_PERIOD)
            try:
                self.link.reconnect()
            except LinkDownError as again:
                error = again
            else:
                if told:
                    self._on_message(f"{self._channel} is back")
                return

    def _tell_outage(self, reason: str) -> bool:
        """Whether there was something new to tell."""
        before, when = self._last_outage
        now = time.monotonic()
        self._last_outage = reason, now
        is_new = reason != before or now - when > SILENCE
        if is_new:
            self._on_message(f"waiting for the interface: {reason}")
        return is_new

    def _finish(self) -> None:
        """Publish what is complete, and a last status frame, as far as the link takes them."""
        with contextlib.suppress(LinkDownError):
            self._outbox.post(self.core.finish())
            self._outbox.post(self._status(time.monotonic_ns()))
            self._outbox.drain(LAST_FRAMES)
        self._outbox.discard()

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
        return self.link.dropped

    @property
    def unsent(self) -> int:
        """Results given up because the link had no room for them, or was down."""
        return self._outbox.unsent

    @property
    def troubles(self) -> int:
        """How often the interface went down or away, and its controller error-passive or bus-off."""
        condition = self.link.condition
        return self._outages + condition.passives + condition.bus_offs

    def _status(self, now: int) -> list[OutputFrame]:
        state, reason = self.state(now)
        figures = LinkFigures(self.dropped, self.troubles)
        injector_id = self._bench.config.outputs.injector_id
        return self._status_writer.write(
            status_values(self.core, state, reason, injector_id, self._hashes, figures)
        )
