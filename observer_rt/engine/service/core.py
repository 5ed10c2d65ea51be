"""The service without its surroundings: frames in, frames out. No socket, no clock, no file.

Where another node sends the messages of this service, no receiver knows whose frame it has: no result is valid.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from observer_rt.bus.alignment import MessageTiming, indices_of, is_stale, make_alignment, make_timekeeping, timing_of
from observer_rt.bus.links.link import BusFrame, Frame, FrameBlock, block_of
from observer_rt.bus.mapping.bus_map import BusMap, stream_of
from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import Role
from observer_rt.core.frames.frames import E2EState
from observer_rt.core.stream.stream import RING, dead_band
from observer_rt.engine.learning.knowledge import Knowledge, no_knowledge
from observer_rt.engine.observer import make_observer, samples_at
from observer_rt.engine.reports.injection_report import report_of
from observer_rt.engine.reports.news import Listener, Notice, fan_out
from observer_rt.engine.service import injector, messages, noise
from observer_rt.engine.service.judging import InlineExecutor, Judging
from observer_rt.engine.service.optional_inputs import OptionalInputs
from observer_rt.engine.stream.standstill import LiftFigures, Standstill, lift_figures, standstill_of
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.stream.validity import ServiceCondition, state_of_service
from observer_rt.engine.words import Topic, is_good
from observer_rt.foundation.units import Floats, Structs
from observer_rt.foundation.version import __version__
from observer_rt.model.effective import Coefficients
from observer_rt.model.surroundings import filed

if TYPE_CHECKING:
    from observer_rt.engine.service.noise import SlowNoise

_NOT_LEARNED = "nothing was learned from an event: {}\n  remedy: see that memory is free; report it if it comes again"


class SecondSender:
    """Whether another node sends our results now, and between which samples it did so last."""

    def __init__(self, publisher: Structs, observer: Structs) -> None:
        """publisher, observer: their memory; no rate that the publisher sends meanwhile is valid."""
        self._is_contested = publisher["contested"]
        self._processed = observer["positions"]["processed"]
        self._first = self._end = 0

    def note(self, is_contested: bool) -> None:
        """Notes whether there is a second sender; the stream may go on meanwhile."""
        if is_contested == self._is_contested[0]:
            return
        if is_contested:
            self._first = int(self._processed[0])
        self._is_contested[0] = is_contested
        if not is_contested:
            self._end = int(self._processed[0])

    def concerns(self, injection: np.void) -> bool:
        """Whether the report of an injection, `stream.state.INJECTION`, is contested now, or its rates were."""
        was_contested = injection["end_position"] >= self._first and injection["start_position"] < self._end
        return bool(self._is_contested[0] or was_contested)


class Core:
    """One injector's observer service on frames, in the order received.

    The same frames give the same `InjectionRate` and `InjectionSummary` frames, bit for bit, if no adoption is late.
    """

    def __init__(
        self,
        bench_injector: BenchInjector,
        bus: BusMap,
        knowledge: Knowledge | None = None,
        executor: Executor | None = None,
        learning: bool | None = None,
        listeners: Sequence[Listener] = (),
        learner_of: injector.LearnerFactory = injector.make_learner,
        assumes_filed: bool = False,
        writes_summaries: bool = True,
        commanded: bool | None = None,
    ) -> None:
        """bench_injector: with its sections of the bench file; bus: its frames; knowledge: from an earlier run.

        executor: of learning, None: in lockstep; learning: None: as the bench file states; listeners: called with
        reports and notices; learner_of: makes the learner; its errors are raised, `UserError` where training does not
        fit injector or sample rate; assumes_filed: surroundings are the file's until measured, else nothing is valid;
        commanded: a pilot valve goes by commands, None: where the bus tells their samples.
        """
        config = bench_injector.config
        is_restored = knowledge is not None
        constants = injector.bench_constants(bench_injector, is_restored)
        if assumes_filed:
            constants = constants._replace(surroundings=filed(bench_injector.parameters, config.signals.surroundings))
        if bus.tells_commands if commanded is None else commanded:
            constants = constants.by_commands()
        levels = noise.configured_noise(bench_injector)
        start = knowledge or no_knowledge(levels, constants.coefficients.pressure_scale)
        learner = self.learner = learner_of(bench_injector, constants, start)
        """Learns from events, in the executor."""
        self._bus = bus
        self._max_lift = bench_injector.parameters.seat.max_lift
        healthy = injector.healthy_injector(bench_injector)
        may_learn = healthy.adequate and (config.learning.enabled if learning is None else learning)
        observer = make_observer(constants, start, learner, healthy)
        opens, _ = dead_band(levels.needle_lift)
        self.compiled = messages.CompiledPipeline(
            messages.Pipeline(
                bus.inputs,
                messages.make_receiver(),
                messages.make_supervised(bus.inputs.messages, config.e2e),
                messages.make_input_memory(bus.inputs, may_learn, constants.surroundings),
                make_timekeeping(
                    bus.inputs.timing, bus.inputs.streams["samples"], stream_of(bus, Role.LINE_PRESSURE)
                ),
                make_alignment(bus.grid_relations, opens, observer.recorded, bus.spared, bus.has_lift),
                observer,
                messages.make_publisher(bus.rate, may_learn),
            )
        )
        """Everything compiled code works on."""
        self.compiled.observer.memory["mode"]["waits_for_verdicts"] = executor is None or config.learning.lockstep
        self._tell = fan_out(listeners)
        self._judging = Judging(
            self.compiled,
            learner,
            executor or InlineExecutor(),
            start,
            healthy,
            lambda failure: self._tell(
                Notice(Topic.LEARNING, _NOT_LEARNED.format(f"{type(failure).__name__}: {failure}"))
            ),
        )
        self._writes_summaries = writes_summaries
        self.optional = OptionalInputs(bench_injector, bus, self.compiled, self._tell, is_restored)
        """Energizing, surroundings and learning enable as received."""
        self.second_sender = SecondSender(self.compiled.pipeline.publisher.memory, self.compiled.observer.memory)
        """Whether another node sends the same results."""
        self._results = messages.ResultFrames(bus, self.compiled.pipeline.publisher, config.outputs.injector_id)

    def handle(
        self, frame_id: int, is_extended: bool, payload: bytes, stamp_ns: int, bus: int = 0
    ) -> list[messages.OutputFrame]:
        """Takes one frame received on a bus and returns the frames to send; ignores frames that are not ours.

        frame_id: 29 bits where `is_extended`, else 11; bus: from 0; stamp_ns: received at, on one clock for all buses
        [ns]: it changes no result where all messages of one time base carry an index.
        """
        return self.handle_many(block_of([BusFrame(bus, Frame(frame_id, payload, stamp_ns, is_extended))]))

    def handle_many(self, block: FrameBlock) -> list[messages.OutputFrame]:
        """Takes many frames in arrays, at the speed of compiled code, and returns the frames to send."""
        number = 0
        while number < block.frames:
            number, waits = self.compiled.take_many(block, number)
            self._go_on(waits)
            self._results.collect_results()
        return self._results.taken()

    def attend(self) -> list[messages.OutputFrame]:
        """Handles what the stream did meanwhile; returns the frames to send, rates left in the publisher."""
        self._go_on(waiting=False)
        return self._results.taken()

    def answer(self) -> list[messages.OutputFrame]:
        """Goes on as `attend`, with the model, the command or the verdict that the stream waits for."""
        self._follow()
        self._answer()
        return self._results.taken()

    def call_when_learned(self, wake: Callable[[], None]) -> None:
        """Have the executor call `wake` when something was learned, which `attend` then hands to the stream."""
        self._judging.on_learned = wake

    @property
    def is_between_events(self) -> bool:
        """Whether no injection is under way, nor any to be judged."""
        return self._judging.is_idle and not self.compiled.observer.memory[0]["event"]["in_event"]

    def finish(self) -> list[messages.OutputFrame]:
        """Ends the frames: processes what waits, judges every event, and returns the last frames to send."""
        self.compiled.observer.memory["mode"]["draining"] = True
        self.compiled.observer.memory["mode"]["waits_for_verdicts"] = True
        self._go_on(self.compiled.proceed())
        self._results.collect_results()
        self.compiled.flush()
        self._results.collect_results()
        return self._results.taken()

    @property
    def processed(self) -> int:
        """Samples processed since the start: the position of the next one."""
        return int(self.compiled.observer.memory[0]["positions"]["processed"])

    def rows(self, start: int, end: int) -> Structs:
        """Copies of samples at positions [start, end) of the last `RING`, dtype `stream.state.sample_dtype`."""
        return samples_at(self.compiled.observer, max(start, end - RING), end)

    def inputs(self, first: int, most: int) -> dict[Role, Floats]:
        """Remembered samples (n,) of every role [m; Pa above chamber] from `first` on, thinned evenly to `most`."""
        first = max(first, self.processed - RING)
        places = np.arange(first, self.processed, 1 + (self.processed - first) // most) % RING
        ring = self.compiled.observer.ring
        return {
            role: ring[role.value][places] * (1.0 if role is Role.NEEDLE_LIFT else self.coefficients.pressure_scale)
            for role in Role
        }

    @property
    def newest(self) -> Floats:
        """Last value received [SI] of every role (roles,), in the order of `Role`; nan: not available."""
        return np.asarray(self.compiled.pipeline.receiver["sample"][0], np.float64)

    @property
    def protection(self) -> list[int]:
        """`E2EState` of every input message, those with samples first; NODATA of one that is not protected."""
        return list(self.compiled.pipeline.supervised["state"].tolist())

    @property
    def progress(self) -> list[int]:
        """Sample index that each input stream has reached; -1 before its first sample."""
        return indices_of(self.compiled.pipeline.alignment, "next_index")

    @property
    def begun_at(self) -> list[int]:
        """Sample index at which each of our input messages began; -1 before its first frame."""
        return indices_of(self.compiled.pipeline.alignment, "first_index")

    @property
    def state(self) -> tuple[State, Reason]:
        """State and reason by the inputs alone, without the links."""
        newest = None
        if self.processed > 0:
            newest = State(int(self._newest_row["state"])), Reason(int(self._newest_row["reason"]))
        sampled = self.protection[: len(self._bus.input_layouts)]
        condition = ServiceCondition(
            is_unprotected=E2EState.INVALID in sampled,
            is_stale=newest is not None and is_stale(self.compiled.pipeline.alignment),
        )
        return state_of_service(newest, condition)

    @property
    def is_valid(self) -> bool:
        """Whether the estimate of the last processed sample is."""
        return self.processed > 0 and bool(self._newest_row["valid"])

    @property
    def last_index(self) -> int:
        """Device index of the last processed sample, 0 before the first."""
        return int(self._newest_row["index"]) if self.processed else 0

    @property
    def knowledge(self) -> Knowledge:
        """Knowledge learned and judged so far."""
        return self._judging.knowledge

    @property
    def standstill(self) -> Standstill:
        """Statistics of the closed needle since the start."""
        figures = standstill_of(self.compiled.observer.memory[0], self.coefficients.pressure_scale)
        return replace(figures, lift=self.lift)

    @property
    def lift(self) -> LiftFigures:
        """Findings about the needle-lift sensor."""
        return lift_figures(self.compiled.observer, self._max_lift)

    @property
    def slow_noise(self) -> "Mapping[Role, SlowNoise]":
        """Slow noise of line pressure [Pa] and needle lift [m], of the samples at rest that are remembered."""
        white = self.standstill.noise
        if white is None:
            return {}
        return noise.slow_noise_of(self.compiled.observer, self.rows(0, self.processed), white)

    @property
    def timing(self) -> tuple[MessageTiming, ...]:
        """Regularity of the input messages, as far as their stamps show it."""
        return timing_of(self._bus, self.compiled.pipeline.keeping)

    @property
    def counters(self) -> messages.Counters:
        return messages.counted(self.parts)

    @property
    def parts(self) -> dict[str, Any]:
        """Parts that count, by the names that sources of `OutputSignal` have for them."""
        pipeline = self.compiled.pipeline
        return {
            "core": self,
            "receiver": pipeline.receiver[0],
            "supervised": pipeline.supervised,
            "alignment": pipeline.alignment.memory[0],
            "observer": pipeline.observer.memory[0],
            "judging": self._judging,
            "energizing": self.optional.energizing,
        }

    @property
    def frames_taken(self) -> int:
        """Frames with samples that came so far, good or bad."""
        return int(self.compiled.pipeline.receiver["frames"][0])

    def _go_on(self, waiting: bool) -> None:
        """Hand over closed events, judge due ones, change the model, until the observer waits for input again."""
        self._follow()
        while waiting:
            self._results.collect_results()
            self._answer()
            waiting = self.compiled.proceed()
            self._follow()
        self._judging.post()
        self.optional.look()

    def _answer(self) -> None:
        """Give the stream the model, the command or the verdict that it waits for."""
        judgement = self.compiled.observer.memory[0]["judgement"]
        if not self.optional.answer() and judgement["waiting"]:  # else it was read meanwhile
            self._judging.answer()
            judgement["waiting"] = False

    def _follow(self) -> None:
        """Hand over closed events; report the injections of judged ones after any notices before them."""
        for judged in self._judging.follow(self.optional.learning):
            self.optional.read()
            for injection in self._judging.injections(judged):
                commanded = self.optional.opening_of(injection)
                report = report_of(injection, judged, commanded, self.second_sender.concerns(injection))
                if self._writes_summaries:
                    self._results.add_summary(report, self.optional.learning, self.coefficients.pressure_scale)
                self._tell(report)
                self.optional.on_injection(report)

    @property
    def _newest_row(self) -> np.void:
        row: np.void = self.compiled.observer.ring[(self.processed - 1) % RING]
        return row

    @property
    def coefficients(self) -> Coefficients:
        return self.compiled.observer.constants.coefficients


def status_parts(core: Core, state: State, reason: Reason, others: Mapping[str, Any]) -> dict[str, Any]:
    """Sources of the values of a status; others: parts of links and files, beside those of the core."""
    version = dict(zip(("major", "minor", "patch"), map(int, __version__.split(".")[:3]), strict=True))
    valid = core.is_valid and is_good(state)
    return {**core.parts, "valid": valid, "state": state, "reason": reason, "version": version, **others}
