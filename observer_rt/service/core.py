"""The service without its surroundings: frames in, frames out. No socket, no clock, no file."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.alignment import is_stale
from observer_rt.bus.alignment_memory import make_alignment
from observer_rt.bus.mapping import BusMap, frame_key, stream_of
from observer_rt.bus.timekeeping import make_timekeeping
from observer_rt.config import Bench, Role
from observer_rt.errors import UserError
from observer_rt.estimation.gain import NoiseLevels
from observer_rt.model.effects import effective_model
from observer_rt.model.stability import MAX_SUBSTEPS, fastest_rate
from observer_rt.observer.front_end import dead_band
from observer_rt.observer.knowledge import Knowledge, Outcome, Verdict, no_knowledge
from observer_rt.observer.observer import (
    Durations,
    constants_for,
    event_standstill,
    event_window,
    in_force,
    judge,
    make_observer,
)
from observer_rt.observer.standstill import Standstill, standstill_of
from observer_rt.observer.state import INJECTIONS, RING, Constants, Reason, State
from observer_rt.paper.network import FreeNetwork
from observer_rt.service.counters import Counters
from observer_rt.service.learners import LearnerFactory, make_learner
from observer_rt.service.measured_mass import MeasuredMass
from observer_rt.service.message_timing import MessageTiming, timing_of
from observer_rt.service.optional_inputs import OptionalInputs
from observer_rt.service.output import FrameWriter, OutputFrame, summary_values
from observer_rt.service.pipeline import Pipeline, handle, make_receiver, proceed
from observer_rt.service.publisher import flush, make_publisher
from observer_rt.service.report import InjectionReport, report_of
from observer_rt.service.training import InlineExecutor, Training
from observer_rt.units import MEGAPASCAL, MICROMETRE, MILLISECOND

EVENTS_REQUIRED = 2  # judged, before a sample is valid
EVENTS_REQUIRED_RESTORED = 1  # the same with a restored state


def configured_noise(bench: Bench) -> NoiseLevels:
    """Noise levels of the bench file, SI."""
    noise = bench.config.noise
    return NoiseLevels(
        rail_pressure=noise.rail_pressure_MPa * MEGAPASCAL,
        line_pressure=noise.line_pressure_MPa * MEGAPASCAL,
        needle_lift=noise.needle_lift_um * MICROMETRE,
    )


def bench_constants(bench: Bench, restored: bool = False) -> Constants:
    """Constants of the observer for a bench. Raises `UserError` when its sample rate is too low to integrate."""
    rate = bench.config.sampling.rate_hz
    learning = bench.config.learning
    durations = Durations(learning.event_gap_ms * MILLISECOND, learning.learning_delay_ms * MILLISECOND)
    constants = constants_for(
        bench.injector, rate, durations, EVENTS_REQUIRED_RESTORED if restored else EVENTS_REQUIRED
    )
    substeps = constants.substeps
    if substeps > MAX_SUBSTEPS:
        model = effective_model(bench.injector)
        fastest = fastest_rate(model.injector, model.departures)
        raise UserError(
            f"{bench.path}: sampling.rate_hz",
            f"{rate:g} Hz would need {substeps} integration steps a sample (at most {MAX_SUBSTEPS}), "
            f"for the sac of {bench.injector_path.name} relaxes at up to {fastest:.3g} 1/s",
            f"sample at {rate * substeps / MAX_SUBSTEPS:.0f} Hz or more",
        )
    return constants


class Core:
    """One injector's observer service on frames.

    `handle` takes frames in the order received and returns the frames they cause. The same frames give the same
    `InjectionRate` and `InjectionSummary` frames, bit for bit, as long as no adoption is late.
    """

    def __init__(
        self,
        bench: Bench,
        bus: BusMap,
        knowledge: Knowledge | None = None,
        executor: Executor | None = None,
        learning: bool | None = None,
        on_report: Callable[[InjectionReport], None] | None = None,
        on_measured: Callable[[MeasuredMass], None] | None = None,
        learner_of: LearnerFactory = make_learner,
    ) -> None:
        """knowledge: restored from an earlier run; executor: where learning runs (None: at once, in lockstep).

        on_report is called with every injection, on_measured then, or later, with those whose mass was measured.
        """
        config = bench.config
        self._bus = bus
        self._constants = bench_constants(bench, restored=knowledge is not None)
        self._pressure_scale = self._constants.coefficients.pressure_scale
        noise = configured_noise(bench)
        start = knowledge or no_knowledge(noise, self._pressure_scale)
        learning = config.learning.enabled if learning is None else learning
        self._optional = OptionalInputs(bus.slow, learning, on_measured)
        self._injector_id = config.outputs.injector_id
        learner = learner_of(bench, self._constants, start)
        lockstep = executor is None or config.learning.lockstep
        self._training = Training(learner, executor or InlineExecutor(), lockstep)
        self._observer = make_observer(self._constants, start, learner)
        self._pipeline = Pipeline(
            bus.inputs,
            make_receiver(),
            make_timekeeping(
                bus.inputs.timing, bus.inputs.streams["samples"], stream_of(bus, Role.LINE_PRESSURE)
            ),
            make_alignment(bus.following, dead_band(noise.needle_lift)[0]),
            self._observer,
            make_publisher(bus.rate, learning),
        )
        self._rate_layout = bus.rate.layout if bus.rate else None
        self._summary_writer = FrameWriter(bus.summary)
        self._on_report = on_report or (lambda _: None)
        self._known = start
        self._events_submitted = 0
        self._rejected = 0
        self._free_rows: FreeNetwork | None = None
        self._first_version = start.phi_version
        self._frames: list[OutputFrame] = []

    def handle(self, frame_id: int, is_extended: bool, payload: bytes, stamp_ns: int) -> list[OutputFrame]:
        """Take one received frame; frames that are not ours are ignored. Returns the frames to send.

        stamp_ns: when it was received, in nanoseconds on a clock that is the same for all frames. Where all
        messages of one time base carry an index, it changes no result.
        """
        data = np.frombuffer(payload, np.uint8)
        key = frame_key(frame_id, is_extended)
        if self._optional.take(key, data, self._observer):
            self._pipeline.publisher.memory["learning"] = self.learning
        waiting = handle(self._pipeline, key, data, stamp_ns)
        return self._go_on(waiting)

    def finish(self) -> list[OutputFrame]:
        """No frame will come: process what waits, judge every event, publish the last block."""
        self._observer.memory["draining"] = True
        frames = self._go_on(proceed(self._pipeline))
        flush(self._pipeline.publisher)
        self._collect_rate_frames()
        return frames + self._taken_frames()

    @property
    def processed(self) -> int:
        """Samples processed since the start: the position of the next one."""
        return int(self._observer.memory["processed"][0])

    def rows(self, start: int, end: int) -> NDArray[np.void]:
        """Processed samples at positions [start, end) as a copy, dtype `observer.state.SAMPLE`.

        Only the last `RING` samples are remembered.
        """
        return self._observer.ring[np.arange(max(start, end - RING), end) % RING]

    @property
    def state(self) -> tuple[State, Reason]:
        """State and reason of the last processed sample."""
        if self.processed == 0:
            return State.STARTING, Reason.STARTING
        if is_stale(self._pipeline.alignment):
            return State.DEGRADED, Reason.INPUT_STALE
        row = self._observer.ring[(self.processed - 1) % RING]
        return State(int(row["state"])), Reason(int(row["reason"]))

    @property
    def learning(self) -> bool:
        """Whether learning is enabled, by the bench and by its learning enable, if it has one."""
        return self._optional.learning

    @property
    def last_index(self) -> int:
        """Device index of the last processed sample, 0 before the first."""
        return int(self._observer.ring[(self.processed - 1) % RING]["index"]) if self.processed else 0

    @property
    def knowledge(self) -> Knowledge:
        """All that was learned and judged so far."""
        return self._known

    @property
    def standstill(self) -> Standstill:
        """Statistics of the closed needle since the start."""
        return standstill_of(self._observer.memory[0], self._pressure_scale)

    @property
    def timing(self) -> tuple[MessageTiming, ...]:
        """How regularly the input messages come, as far as their stamps show it."""
        return timing_of(self._bus, self._pipeline.keeping)

    @property
    def counters(self) -> Counters:
        """What was counted so far."""
        receiver = self._pipeline.receiver[0]
        alignment = self._pipeline.alignment.memory[0]
        memory = self._observer.memory[0]
        return Counters(
            samples=self.processed,
            lost_samples=int(alignment["lost"]),
            interpolated_samples=int(memory["interpolated"]),
            frames=int(receiver["frames"]),
            crc_errors=int(receiver["crc_errors"]) + self._optional.crc_errors,
            length_errors=int(receiver["length_errors"]) + self._optional.length_errors,
            sequence_errors=int(receiver["sequence_errors"]),
            repeated_frames=int(alignment["repeated"]),
            old_frames=int(alignment["old"]),
            restarts=int(alignment["restarts"]),
            jumps=int(alignment["jumps"]),
            events=int(memory["events_judged"]),
            injections=int(memory["injections_reported"]),
            adoptions=int(memory["phi_version"]) - self._first_version,
            rejected_adoptions=self._rejected,
            late_adoptions=self._training.late,
        )

    def _go_on(self, waiting: bool) -> list[OutputFrame]:
        """Hand over closed events, judge due ones, until the observer waits for input again."""
        self._submit_events()
        self._collect_rate_frames()
        while waiting:
            self._judge()
            waiting = proceed(self._pipeline)
            self._submit_events()
            self._collect_rate_frames()
        return self._taken_frames()

    def _submit_events(self) -> None:
        closed = int(self._observer.memory["events_closed"][0])
        while self._events_submitted < closed:
            window = event_window(self._observer, self._events_submitted) if self.learning else None
            standstill = event_standstill(self._observer, self._events_submitted)
            self._training.submit(window, standstill, in_force(self._observer))
            self._events_submitted += 1

    def _judge(self) -> None:
        outcome = self._training.take()
        event = self._observer.memory[0]["events"][self._head()].copy()
        judge(self._observer, outcome)
        if outcome is not None:
            self._rejected += outcome.verdict is not Verdict.ADOPTED
            self._free_rows = outcome.free_rows
            version = int(self._observer.memory["phi_version"][0])
            self._known = replace(outcome.knowledge, phi_version=version)
        self._report_injections(event, outcome)

    def _head(self) -> int:
        memory = self._observer.memory[0]
        return int(memory["events_taken"]) % len(memory["events"])

    def _report_injections(self, event: np.void, outcome: Outcome | None) -> None:
        memory = self._observer.memory[0]
        while memory["injections_reported"] < memory["injections_begun"]:
            injection = memory["injections"][int(memory["injections_reported"]) % INJECTIONS]
            if injection["event"] > event["number"]:
                break
            memory["injections_reported"] += 1
            carried = in_force(self._observer), self._free_rows
            report = report_of(injection, event, outcome, *carried, self._constants.coefficients)
            values = summary_values(report, self._injector_id, self.learning, self._pressure_scale)
            self._frames += self._summary_writer.write(values)
            self._on_report(report)
            self._optional.on_report(report)

    def _collect_rate_frames(self) -> None:
        publisher = self._pipeline.publisher
        count = int(publisher.memory["frames"][0])
        layout = self._rate_layout
        if layout is None:
            return
        for frame in publisher.out[:count]:
            payload = frame["payload"][: int(frame["length"])].tobytes()
            self._frames.append(OutputFrame(layout.frame_id, layout.is_extended, layout.is_fd, payload))
        publisher.memory["frames"] = 0

    def _taken_frames(self) -> list[OutputFrame]:
        frames, self._frames = self._frames, []
        return frames
