"""Recordings and CAN logs through the same core as the daemon, part by part.

Memory does not depend on their length: results are spooled to a temporary file; samples pass by, unless they are
stored as a trace.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from observer_rt.config.bench import Bench
from observer_rt.desk.evaluation.curves import InjectionResult, RateCurves, injection_result, rate_curves
from observer_rt.desk.evaluation.logged import LoggedSignals
from observer_rt.desk.evaluation.run import ObserverRun, Progress
from observer_rt.desk.evaluation.segment import (
    SAMPLE,
    Segment,
    Signal,
    Trace,
    open_trace,
    trace_arrays,
    trace_of,
)
from observer_rt.desk.evaluation.spool import Spool
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.learning.learned_curves import LearnedCurve, learned_curves
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.reports.news import MeasuredMass
from observer_rt.engine.service.injector import LearnerFactory, make_learner
from observer_rt.engine.service.messages import Counters, OutputFrame
from observer_rt.engine.stream.standstill import Standstill
from observer_rt.files.replay.framing import bench_for
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import HeldSignals, SignalStream
from observer_rt.files.signals.table_writers import TableWriter
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.model.effective import Coefficients

_IN_MEMORY = 512  # injections, some KB each


class Evaluation:
    """One file evaluated: its injections, in a temporary file; its samples pass by, or are stored as a trace."""

    first_index: int
    """The sample index its first sample was sent with."""
    counters: Counters
    standstill: Standstill
    has_energizing: bool
    """Whether the bench has this input, so that reports and counters include commands."""
    learned: tuple[LearnedCurve, ...]
    """Laws of nozzle and seat as they were known at its end."""

    def __init__(
        self, source: SignalStream, curves_of: Coefficients | None = None, keeps_trace: bool = False
    ) -> None:
        """curves_of: the nominal model, where curves of all injections are drawn; keeps_trace: in memory."""
        self.path = source.path
        self.sample_rate = source.sample_rate
        self.has_rate = "injection_rate" in source.optional
        self.injections: Spool[InjectionResult] = Spool(_IN_MEMORY)
        self.curves: Spool[RateCurves] = Spool()
        """Curves of every injection, in their order, where any are drawn."""
        self.source = source
        self.samples = source.samples
        """Number of samples of the recording."""
        self._curves_of = curves_of
        self._held: InjectionResult | None = None  # until no measured mass can come for it
        self.writer: TableWriter | None = None
        """Writes the trace, where it goes to a file."""
        self._traces: list[Trace] | None = [] if keeps_trace else None

    def __getstate__(self) -> dict[str, Any]:
        """A copy is a result: it holds no open file."""
        return {**vars(self), "source": None, "writer": None}

    @cached_property
    def trace(self) -> Trace:
        """Trace of all n samples, empty where it is not kept."""
        return trace_of(np.concatenate([np.empty(0, SAMPLE), *(self._traces or [])]))

    @property
    def time(self) -> Signal:
        """Times of the samples of the trace [s] (n,)."""
        time: Signal = self.trace.time
        return time

    @property
    def level(self) -> str:
        """How well the level of its masses is known, in words; empty where nothing is unknown of it."""
        return self.injections[-1].report.calibration.as_text() if len(self.injections) else ""

    @cached_property
    def reports(self) -> tuple[InjectionReport, ...]:
        """Reports of all injections, without the course of their sigma."""
        return tuple(injection.report for injection in self.injections)

    def take_report(self, segment: Segment, report: InjectionReport) -> None:
        """Take the report of an injection, whose samples the segment remembers."""
        self.finish()
        self._held = injection_result(replace(report, rate_sigma=None), segment, self.sample_rate)
        if self._curves_of is not None:
            self.curves.append(rate_curves(report, segment, self._curves_of))

    def take_measured(self, measured: MeasuredMass) -> None:
        """Take the measured mass of the injection reported last; a measured rate goes before it."""
        held = self._held
        if held is not None and held.report.number == measured.report.number and not self.has_rate:
            self._held = replace(held, measured_mass=measured.mass)

    def take_passed(self, passed: Trace) -> None:
        """Append samples to the trace."""
        if self.writer is not None:
            self.writer.write(trace_arrays(passed))
        if self._traces is not None:
            self._traces.append(passed.copy())

    def observe(self, run: ObserverRun) -> None:
        """Give all its frames to an observer."""
        if isinstance(self.source, LoggedSignals):
            segments = _segments(self.source, self)
            run.take_frames(self.source.frames, segments)
        else:
            segments = run.take(self.source, self)
        self.first_index = segments[0].first_index

    def finish(self) -> None:
        """No measured mass will come for the injection reported last."""
        if self._held is not None:
            self.injections.append(self._held)
            self._held = None


@dataclass(frozen=True)
class History:
    """Recordings evaluated one after another by one observer, and what it knows at the end."""

    evaluations: tuple[Evaluation, ...]
    knowledge: Knowledge
    frames: tuple[OutputFrame, ...]


def evaluate(
    bench: Bench,
    recordings: Sequence[Recording | SignalStream],
    knowledge: Knowledge | None = None,
    learning: bool = True,
    progress: Progress | None = None,
    learner_of: LearnerFactory = make_learner,
    curves_of: Coefficients | None = None,
    traces: Sequence[Path] | None = None,
    reads_ahead: bool = True,
) -> History:
    """Evaluate recordings as one history, learning in lockstep.

    Every recording goes through the bench's bus codec, so that the result equals that of the daemon bit for bit;
    the frames of a log, as `LoggedSignals`, go in as they are. Between two recordings the sample index jumps, as
    between two windows of a windowed source; that of a log must go on beyond that of the one before.

    knowledge: learned before; learning: whether the recordings are learned from; progress: takes the number of
    samples processed; learner_of: makes the learner of the bench's injector; curves_of: as of `Evaluation`; traces:
    files to be written of the first of the recordings, None: all traces, and frames, are kept in memory; reads_ahead:
    as of `ObserverRun`.
    Raises `UserError` for a recording whose sample rate is not the bench's.
    """
    sources = [HeldSignals(each) if isinstance(each, Recording) else each for each in recordings]
    evaluations = [Evaluation(source, curves_of, keeps_trace=traces is None) for source in sources]
    bench, fuel_temperature, commanded = bench_for_all(bench, sources), None, None
    if not any(isinstance(source, LoggedSignals) for source in sources):
        fuel_temperature = bench.injector.parameters.fluid.reference_temperature  # a recording knows none
        commanded = all("energizing" in source.optional for source in sources)
    with ExitStack() as stack:
        for path, evaluation in zip(traces or (), evaluations, strict=False):
            stack.enter_context(file_errors(path))
            evaluation.writer = stack.enter_context(open_trace(path))
        run = ObserverRun(
            bench,
            knowledge,
            learning,
            progress,
            learner_of,
            fuel_temperature,
            keeps_frames=traces is None,
            reads_ahead=reads_ahead,
            commanded=commanded,
        )
        core, before = run.core, run.core.counters
        for evaluation in evaluations:
            evaluation.observe(run)
            if evaluation is evaluations[-1]:
                run.finish()
            evaluation.counters, evaluation.standstill = core.counters.since(before), core.standstill
            evaluation.has_energizing = core.optional.energizing is not None
            evaluation.learned = learned_curves(core.knowledge, core.coefficients)
            before = core.counters
        for evaluation in evaluations:
            evaluation.finish()
    return History(tuple(evaluations), core.knowledge, tuple(run.frames))


def bench_for_all(bench: Bench, sources: Sequence[SignalStream]) -> Bench:
    """The bench as `bench_for` has it for sources of one history. Raises `UserError` where they differ in it."""
    benches = [bench_for(bench, source) for source in sources]
    for source, own in zip(sources, benches, strict=True):
        if own.injector.config.sampling != benches[0].injector.config.sampling:
            raise UserError(
                str(source.path),
                f"is sampled at {source.sample_rate:g} Hz, {sources[0].path} before it at "
                f"{sources[0].sample_rate:g} Hz; or their samples differ in what they mean",
                "recordings of one history must be sampled alike",
            )
    return benches[0]


def _segments(log: LoggedSignals, evaluation: Evaluation) -> list[Segment]:
    """Segments of a log, split at long holes; a hole belongs to the segment before it. Times go on over a restart."""
    segments, offset = [], 0
    for stretch in log.logged:
        bounds = [stretch.first_index, *stretch.resumed, stretch.last_index + 1]
        for first, end in pairwise(bounds):
            segments.append(Segment(evaluation, first, end - first, log.rate, offset))
            offset += end - first
    return segments
