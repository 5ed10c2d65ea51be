"""The daemon: a thin loop round the core, from the buses back onto them."""

import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from observer_rt.bus.database.lookup import database_hash
from observer_rt.bus.links.link import BusDownError, Link, LinkDownError
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.config.bench import Bench
from observer_rt.config.signals import Role
from observer_rt.daemon.input_watch import PERIOD as LOOK_PERIOD
from observer_rt.daemon.input_watch import InputWatch, StateWatch
from observer_rt.daemon.port import RETRY, Port
from observer_rt.daemon.pump import FramePump, Latency
from observer_rt.daemon.rights import drop_priority, touch
from observer_rt.daemon.signal_watch import LIFT_MOVED
from observer_rt.daemon.state_file import model_hash
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.reports.news import Listener, Notice, fan_out
from observer_rt.engine.service.core import Core, status_parts
from observer_rt.engine.service.messages import FrameWriter, OutputFrame
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.stream.validity import ServiceCondition, contested, state_of_service
from observer_rt.engine.words import REASONS, Topic
from observer_rt.foundation.units import NANOSECONDS

RECEIVE_TIMEOUT = 0.02  # s, after which the loop looks at its clock and its stop signal
INPUT_TIMEOUT = 0.5  # s without an input frame: waiting for data
ASLEEP = 1.0  # s between two looks, from which on the process itself stood still
LAST_FRAMES = 0.5  # s for the last results to be sent in


class Daemon:
    """Observes what comes in on the links of a bench until asked to stop."""

    def __init__(
        self,
        bench: Bench,
        bus_map: BusMap,
        links: Sequence[Link],
        knowledge: Knowledge | None = None,
        listeners: Sequence[Listener] = (),
        on_alive: Callable[[], None] = lambda: None,
        failed_writes: Callable[[], int] = lambda: 0,
        on_thread: Callable[[], object] = lambda: None,
        evidence_kept: Callable[[], int] = lambda: 0,
    ) -> None:
        """links: of all buses, in order; knowledge: restored from an earlier run.

        on_alive: called by the loop ten times a second; failed_writes, evidence_kept: numbers for the status;
        on_thread: called first by the loop's thread, to claim its rights.
        """
        self._links = links
        self._bus_map = bus_map
        self._on_thread = on_thread
        self._latency: Callable[[], Latency | None] = lambda: None
        self._tell = fan_out(listeners)
        self._on_alive = on_alive
        self._failed_writes = failed_writes
        self._evidence_kept = evidence_kept
        with_inputs = {layout.bus for layout in bus_map.received}
        self.ports = tuple(
            Port(named.label, named.config.channel, link, number in with_inputs, self._tell)
            for number, (named, link) in enumerate(zip(bench.config.buses, links, strict=True))
        )
        self._executor = ThreadPoolExecutor(1, thread_name_prefix="learning", initializer=drop_priority)
        self._menders = ThreadPoolExecutor(len(self.ports), thread_name_prefix="reconnecting")
        self._injector = bench.injector
        self.core = Core(bench.injector, bus_map, knowledge, self._executor, listeners=listeners)
        self._watch = InputWatch(bench.injector, bus_map, self.core)
        self.arrivals = self._watch.arrivals
        """Arrivals of all input messages, by the monotonic clock, and of others under our identifiers."""
        self._state_watch = StateWatch(self.arrivals)
        self._restarts = 0  # of measuring devices
        self._status_writer = FrameWriter(bus_map.results_of(per_injection=False))
        self._status_period = round(bench.injector.config.outputs.status_period_ms * 1e6)
        self._hashes = (int(model_hash(bench.injector.parameters)[:8], 16), database_hash(bench.databases))
        self._is_waiting = False  # whether results wait for room on some bus
        self._buses_down: list[int] = []  # buses
        self._frames_seen = 0
        self._last_input = 0
        self.last_look = 0
        """When the loop last looked at its state, by the monotonic clock [ns]; 0: it has not begun."""
        self.ready = threading.Event()

    def run(self, stop: threading.Event) -> None:
        """Serve until `stop` is set, then publish the rest; waits for interfaces that are down. Raises `RunError`."""
        self._last_input = self._next_status = self._next_look = time.monotonic_ns()
        self.arrivals.begin(self._last_input)
        touch(self.core.compiled.pipeline)
        bus_map = self._bus_map
        port = self.ports[bus_map.sent[0].bus]  # of all results
        self._pump = FramePump(self._links, self.core, bus_map, self.arrivals, port.count_unsent, self._on_thread)
        self._latency = self._pump.latency
        for idle in set(range(len(self.ports))) - bus_map.buses:
            self._pump.leave_out(idle)
        self.ready.set()
        try:
            while not stop.is_set():
                self._serve_once()
            self._finish()
        finally:
            self._pump.close()
            self._menders.shutdown()
            self._executor.shutdown(cancel_futures=True)

    def _serve_once(self) -> None:
        try:
            results = self._pump.serve(RETRY if self._is_waiting else RECEIVE_TIMEOUT)
        except BusDownError as error:
            self._lose_bus(error.bus, error)
            return
        now = time.monotonic_ns()
        self.core.second_sender.note(self.arrivals.is_contested(now))
        if self.core.frames_taken != self._frames_seen:
            self._frames_seen, self._last_input = self.core.frames_taken, now
        if results or self._is_waiting:
            self._send_results(results)
        if now >= self._next_status:
            self._next_status = now + self._status_period
            self._send_results(self._status(now))
            for port in self.ports:
                port.tell(now)
        if now >= self._next_look:
            self._next_look = now + LOOK_PERIOD
            self._inspect(now)
        for bus in list(self._buses_down):
            if self.ports[bus].try_reconnect(self._menders):
                self._buses_down.remove(bus)
                self._pump.take_back(bus)
                self.arrivals.begin(now)

    def _inspect(self, now: int) -> None:
        """Looks for faults of the inputs, and for the state; inputs on a bus that is down are not judged."""
        slept, self.last_look = (now - self.last_look) / NANOSECONDS if self.last_look else 0.0, now
        if slept > ASLEEP:  # what came meanwhile may be lost, and is no fault of the inputs
            self.arrivals.begin(now)
            remedy = "was it stopped or the computer suspended? else give it a processor"
            self._tell(Notice(Topic.INPUT, f"this process stood still for {slept:.1f} s\n  remedy: {remedy}"))
        if not self._buses_down:
            for notice in self._watch.look(now, self.dropped):
                self._tell(notice)
        before, self._restarts = self._restarts, self.core.counters.restarts
        if self._restarts > before:
            words = REASONS[Reason.DEVICE_RESTARTED]
            self._tell(Notice(Topic.INPUT, f"{words.what}\n  remedy: {words.remedy}"))
        for notice in self._state_watch.look(now, self.standing(now), self._watch.causes):
            self._tell(notice)
        if self._pump.goes_round():
            self._on_alive()

    def _send_results(self, frames: Sequence[OutputFrame]) -> None:
        for bus, port in enumerate(self.ports):
            try:
                port.post((frame for frame in frames if frame.bus == bus), self._pump.sender(bus))
            except LinkDownError as error:
                self._lose_bus(bus, error)
        self._is_waiting = any(port.is_waiting for port in self.ports)

    def _lose_bus(self, bus: int, error: LinkDownError) -> None:
        self._pump.leave_out(bus)
        self._buses_down.append(bus)
        self.ports[bus].go_down(error)
        self._last_input = 0  # what came before is past

    def _finish(self) -> None:
        self._send_results(self._pump.finish())
        self._send_results(self._status(time.monotonic_ns()))
        for bus, port in enumerate(self.ports):
            try:
                port.drain(LAST_FRAMES, self._pump.sender(bus))
            except LinkDownError as error:
                self._lose_bus(bus, error)

    def state(self, now: int) -> tuple[State, Reason]:
        """State and its most severe reason at a monotonic time [ns]."""
        state, reasons = self.standing(now)
        return state, reasons[0] if reasons else Reason.NONE

    def standing(self, now: int) -> tuple[State, tuple[Reason, ...]]:
        """State and all its reasons, the most severe first, at a monotonic time [ns]."""
        is_down = any(self.ports[bus].has_inputs for bus in self._buses_down)
        condition = ServiceCondition(
            has_frames=self._frames_seen > 0,
            is_cut_off=is_down or now - self._last_input > INPUT_TIMEOUT * NANOSECONDS,
            is_stale=bool(self.arrivals.stale_messages(now)),
        )
        state, reason = state_of_service(self.core.state, condition)
        if self.arrivals.is_contested(now):
            return contested(state, reason)
        return state, (reason,) if reason else ()

    @property
    def is_lift_dead(self) -> bool:
        """Whether the lift sensor is dead: by all inputs while lift is used, else by the lift sent since."""
        if not self._injector.is_lift_dead:
            is_away = self.arrivals.lacks_only(Role.NEEDLE_LIFT, time.monotonic_ns())
            return self.core.state[1] is Reason.LIFT_DEAD or self._watch.is_lift_missing or is_away
        receiver, lift = self.core.parts["receiver"], ROLES.index(Role.NEEDLE_LIFT)
        return not receiver["highest"][lift] - receiver["lowest"][lift] > LIFT_MOVED

    @property
    def stands_since(self) -> int:
        """Time since which state and reasons have not changed, by the monotonic clock [ns]."""
        return self._state_watch.since

    @property
    def dropped(self) -> int:
        """Frames lost before they reached the loop."""
        return sum(port.link.dropped for port in self.ports)

    @property
    def unsent(self) -> int:
        """Results given up because their link had no room for them, or was down."""
        return sum(port.unsent for port in self.ports)

    @property
    def failed_writes(self) -> int:
        """Number of failures to write learned state or journal, and lines of the log that were given up."""
        return self._failed_writes()

    @property
    def evidence_kept(self) -> int:
        """Events whose inputs were kept as evidence."""
        return self._evidence_kept()

    @property
    def troubles(self) -> int:
        """Number of times an interface went down or away, or its controller error-passive or bus-off."""
        return sum(port.troubles for port in self.ports)

    @property
    def latency(self) -> Latency | None:
        """Latency of the rates sent so far; None before the first."""
        return self._latency()

    @property
    def troubled_bus(self) -> int:
        """The first bus in trouble, counted from 1; 0: none."""
        return next((n for n, port in enumerate(self.ports, 1) if port.is_in_trouble), 0)

    def _status(self, now: int) -> list[OutputFrame]:
        others = {
            "daemon": self,
            "ages": {role: self.arrivals.age_of(role, now) for role in Role},
            "injector_id": self._injector.config.outputs.injector_id,
            "model_hash": self._hashes[0],
            "database_hash": self._hashes[1],
        }
        return self._status_writer.write(status_parts(self.core, *self.state(now), others))
