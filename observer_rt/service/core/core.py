"""The service without its surroundings: frames in, frames out. No socket, no clock, no file."""

from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.alignment.alignment import is_stale
from observer_rt.bus.alignment.memory import make_alignment, progress
from observer_rt.bus.alignment.message_timing import MessageTiming, timing_of
from observer_rt.bus.alignment.timekeeping import make_timekeeping
from observer_rt.bus.database.frame_key import frame_key
from observer_rt.bus.mapping.bus_map import BusMap, layout_of, stream_of
from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import Role
from observer_rt.observer.learning.knowledge import Adoption, Knowledge, Outcome, no_knowledge
from observer_rt.observer.observer import (
    event_standstill,
    event_window,
    in_force,
    judge,
    make_observer,
)
from observer_rt.observer.stream.front_end import dead_band
from observer_rt.observer.stream.standstill import Standstill, standstill_of
from observer_rt.observer.stream.state import INJECTIONS, RING, Reason, State
from observer_rt.service.core.compiled import CompiledPipeline
from observer_rt.service.core.constants import bench_constants, configured_noise
from observer_rt.service.core.counters import Counters, counted
from observer_rt.service.core.injection_report import InjectionReport, report_of
from observer_rt.service.core.learners import LearnerFactory, make_learner
from observer_rt.service.core.messages import FrameWriter, OutputFrame, summary_values
from observer_rt.service.core.pipeline import Pipeline, make_receiver
from observer_rt.service.core.publisher import flush, make_publisher
from observer_rt.service.core.worker import InlineExecutor, Training
from observer_rt.service.inputs.energizing import EnergizingFigures, Mismatch
from observer_rt.service.inputs.fuel import Fuel
from observer_rt.service.inputs.measured_mass import MeasuredMass
from observer_rt.service.inputs.optional_inputs import OptionalInputs


class Core:
    """One injector's observer service on frames.

    `handle` takes frames in the order received and returns the frames they cause. The same frames give the same
    `InjectionRate` and `InjectionSummary` frames, bit for bit, as long as no adoption is late.
    """

    def __init__(
        self,
        fitted: BenchInjector,
        bus: BusMap,
        knowledge: Knowledge | None = None,
        executor: Executor | None = None,
        learning: bool | None = None,
        on_report: Callable[[InjectionReport], None] | None = None,
        on_measured: Callable[[MeasuredMass], None] | None = None,
        on_mismatch: Callable[[Mismatch], None] | None = None,
        learner_of: LearnerFactory = make_learner,
        fuel_temperature: float | None = None,
    ) -> None:
        """knowledge: restored from an earlier run; executor: where learning runs (None: at once, in lockstep).

        on_report is called with every injection, on_measured then, or later, with those whose mass was measured,
        on_mismatch with those that are missing after a command, or have none.
        fuel_temperature [K]: on a bench that measures it, what to take until it is measured; None: nothing is valid.
        """
        config = fitted.config
        self._bus = bus
        self._stream_buses = [layout_of(bus, n).bus for n in range(len(bus.inputs.streams))]
        is_restored = knowledge is not None
        is_measured = config.signals.fuel_temperature is not None
        self._fuel = Fuel(fuel_temperature if is_measured else None, bench_constants(fitted, is_restored))
        self._fuel_of_events: deque[Fuel] = deque()  # closed, not yet judged
        self._interval = self._fuel.constants.interval
        self._first_index: int | None = None
        self._pressure_scale = self._fuel.constants.coefficients.pressure_scale
        noise = configured_noise(fitted)
        start = knowledge or no_knowledge(noise, self._pressure_scale)
        learning = config.learning.enabled if learning is None else learning
        self._injector_id = config.outputs.injector_id
        learner = learner_of(fitted, self._fuel.constants, start)
        lockstep = executor is None or config.learning.lockstep
        self._training = Training(learner, executor or InlineExecutor(), lockstep)
        self.compiled = CompiledPipeline(
            Pipeline(
                bus.inputs,
                make_receiver(),
                make_timekeeping(
                    bus.inputs.timing, bus.inputs.streams["samples"], stream_of(bus, Role.LINE_PRESSURE)
                ),
                make_alignment(bus.following, dead_band(noise.needle_lift)[0]),
                make_observer(self._fuel.constants, start, learner),
                make_publisher(bus.rate, learning),
            )
        )
        """Everything compiled code works on."""
        constants_at = partial(bench_constants, fitted, is_restored)
        self._optional = OptionalInputs(
            bus, learning, self.compiled, on_measured, on_mismatch, self._fuel, constants_at
        )
        self._rate_layout = bus.rate.layout if bus.rate else None
        self._summary_writer = FrameWriter(bus.summary)
        self._on_report = on_report or (lambda _: None)
        self._known = start
        self._events_submitted = 0
        self._rejected = 0
        self._first_version = start.phi_version
        self._frames: list[OutputFrame] = []

    def handle(
        self, frame_id: int, is_extended: bool, payload: bytes, stamp_ns: int, bus: int = 0
    ) -> list[OutputFrame]:
        """Take one frame received on a bus; frames that are not ours are ignored. Returns the frames to send.

        stamp_ns: when it was received, in nanoseconds on a clock that is the same for all frames of all
        buses. Where all messages of one time base carry an index, it changes no result.
        """
        key = frame_key(frame_id, is_extended, bus)
        data = np.frombuffer(payload, np.uint8)
        if self._bus.slow:
            self._heed_optional(key, data, stamp_ns)
        return self._go_on(self.compiled.handle(key, data, stamp_ns))

    def finish(self) -> list[OutputFrame]:
        """No frame will come: process what waits, judge every event, publish the last block."""
        self.compiled.observer.memory["draining"] = True
        frames = self._go_on(self.compiled.proceed())
        flush(self.compiled.pipeline.publisher)
        self._collect_rate_frames()
        return frames + self._taken_frames()

    def furthest_behind(self, buses: Sequence[int]) -> int:
        """Of some buses the one whose samples are behind those of the others; one without any comes first."""
        sent: dict[int, int] = dict(
            zip(self._stream_buses, progress(self.compiled.pipeline.alignment), strict=True)
        )
        return min(buses, key=lambda bus: sent.get(bus, -1))

    @property
    def processed(self) -> int:
        """Samples processed since the start: the position of the next one."""
        return int(self.compiled.observer.memory["processed"][0])

    def rows(self, start: int, end: int) -> NDArray[np.void]:
        """Processed samples at positions [start, end) as a copy, dtype `stream.state.SAMPLE`.

        Only the last `RING` samples are remembered.
        """
        return self.compiled.observer.ring[np.arange(max(start, end - RING), end) % RING]

    @property
    def state(self) -> tuple[State, Reason]:
        """State and reason of the last processed sample."""
        if self.processed == 0:
            return State.STARTING, Reason.STARTING
        if is_stale(self.compiled.pipeline.alignment):
            return State.DEGRADED, Reason.INPUT_STALE
        row = self.compiled.observer.ring[(self.processed - 1) % RING]
        return State(int(row["state"])), Reason(int(row["reason"]))

    @property
    def learning(self) -> bool:
        """Whether learning is enabled, by the bench and by its learning enable, if it has one."""
        return self._optional.learning

    @property
    def fuel_temperature(self) -> float | None:
        """Of the fuel in force [K]; None where it is not measured."""
        return self._fuel.temperature

    @property
    def energizing(self) -> EnergizingFigures | None:
        """Commands, openings and their delay so far; None for a bench without energizing."""
        return self._optional.energizing

    @property
    def last_index(self) -> int:
        """Device index of the last processed sample, 0 before the first."""
        return int(self.compiled.observer.ring[(self.processed - 1) % RING]["index"]) if self.processed else 0

    @property
    def knowledge(self) -> Knowledge:
        """All that was learned and judged so far."""
        return self._known

    @property
    def standstill(self) -> Standstill:
        """Statistics of the closed needle since the start."""
        return standstill_of(self.compiled.observer.memory[0], self._pressure_scale)

    @property
    def timing(self) -> tuple[MessageTiming, ...]:
        """How regularly the input messages come, as far as their stamps show it."""
        return timing_of(self._bus, self.compiled.pipeline.keeping)

    @property
    def counters(self) -> Counters:
        """What was counted so far."""
        return counted(
            self.compiled.pipeline, self._optional, self._first_version, self._rejected, self._training.late
        )

    def _heed_optional(self, key: int, payload: NDArray[np.uint8], stamp_ns: int) -> None:
        """What a frame brings by optional inputs, or that they stay away, takes effect before its samples do."""
        memory = self.compiled.observer.memory[0]
        now = self._time_of_samples()
        self._optional.take(key, payload, stamp_ns, now)
        self.compiled.pipeline.publisher.memory["learning"] = self.learning
        fuel = self._optional.fuel
        if fuel is None:
            return
        if not memory["in_event"] and fuel.follow(now):
            self._fuel = fuel.fuel
            self.compiled.change_constants(self._fuel.constants)
        memory["doubted"] = Reason.NONE if fuel.is_known(now) else Reason.INPUT_STALE

    def _time_of_samples(self) -> float:
        """Of the newest received sample, since the first [s]; the index of a device may begin with any number."""
        received = int(self.compiled.observer.memory["received"][0])
        if received == 0:
            return 0.0
        index = int(self.compiled.observer.ring[(received - 1) % RING]["index"])
        if self._first_index is None:
            self._first_index = index
        return (index - self._first_index) * self._interval

    def _go_on(self, waiting: bool) -> list[OutputFrame]:
        """Hand over closed events, judge due ones, until the observer waits for input again."""
        self._submit_events()
        self._collect_rate_frames()
        while waiting:
            self._judge()
            waiting = self.compiled.proceed()
            self._submit_events()
            self._collect_rate_frames()
        self._optional.look()
        return self._taken_frames()

    def _submit_events(self) -> None:
        closed = int(self.compiled.observer.memory["events_closed"][0])
        while self._events_submitted < closed:
            window = event_window(self.compiled.observer, self._events_submitted) if self.learning else None
            standstill = event_standstill(self.compiled.observer, self._events_submitted)
            self._training.submit(window, standstill, in_force(self.compiled.observer), self._fuel.constants)
            self._fuel_of_events.append(self._fuel)
            self._events_submitted += 1

    def _judge(self) -> None:
        outcome = self._training.take()
        memory = self.compiled.observer.memory[0]
        event = memory["events"][int(memory["events_taken"]) % len(memory["events"])].copy()
        judge(self.compiled.observer, outcome)
        if outcome is not None:
            self._rejected += outcome.adoption is not Adoption.ADOPTED
            version = int(self.compiled.observer.memory["phi_version"][0])
            self._known = replace(outcome.knowledge, phi_version=version)
        self._report_injections(event, outcome, self._fuel_of_events.popleft())

    def _report_injections(self, event: np.void, outcome: Outcome | None, fuel: Fuel) -> None:
        memory = self.compiled.observer.memory[0]
        while memory["injections_reported"] < memory["injections_begun"]:
            injection = memory["injections"][int(memory["injections_reported"]) % INJECTIONS]
            if injection["event"] > event["number"]:
                break
            memory["injections_reported"] += 1
            carried = in_force(self.compiled.observer), self.compiled.observer.phi
            commanded = self._optional.opening_of(injection)
            report = report_of(injection, event, outcome, *carried, fuel, commanded)
            values = summary_values(report, self._injector_id, self.learning, self._pressure_scale)
            self._frames += self._summary_writer.write(values)
            self._on_report(report)
            self._optional.on_report(report)

    def _collect_rate_frames(self) -> None:
        publisher = self.compiled.pipeline.publisher
        count = int(publisher.memory["frames"][0])
        layout = self._rate_layout
        if layout is None:
            return
        for frame in publisher.out[:count]:
            payload = frame["payload"][: int(frame["length"])].tobytes()
            kind = layout.frame_id, layout.is_extended, layout.is_fd
            self._frames.append(OutputFrame(*kind, payload, layout.bus))
        publisher.memory["frames"] = 0

    def _taken_frames(self) -> list[OutputFrame]:
        frames, self._frames = self._frames, []
        return frames
