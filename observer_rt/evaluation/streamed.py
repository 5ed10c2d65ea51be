"""Files through the observer part by part, in memory that does not depend on their length.

Results are spooled to a temporary file.
"""

import pickle
import tempfile
from array import array
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Generic, TypeVar, overload

from observer_rt.config.bench import Bench
from observer_rt.evaluation.curves import InjectionResult, RateCurves, injection_result, rate_curves
from observer_rt.evaluation.logged import LoggedSignals
from observer_rt.evaluation.passage import Passage
from observer_rt.evaluation.run import ObserverRun, Progress
from observer_rt.evaluation.trace import Signal, Trace, joined, open_trace, trace_arrays
from observer_rt.foundation.files import file_errors
from observer_rt.model.effective import Coefficients
from observer_rt.observer.learning.knowledge import Knowledge
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.recording.replay.framing import bench_for
from observer_rt.recording.signals.stream import SignalStream
from observer_rt.recording.signals.table_writers import TableWriter
from observer_rt.service.core.learners import LearnerFactory, make_learner
from observer_rt.service.core.messages import Counters
from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.reports.news import MeasuredMass
from observer_rt.service.warm_up import awaited, learning_compiled_beside

T = TypeVar("T")


class Spool(Sequence[T], Generic[T]):
    """Things appended one after another and read back as often as wanted; gone with the process."""

    def __init__(self, in_memory: int = 1) -> None:
        """in_memory: how many are kept there before they go to the file together, and when they come back from it."""
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 - as long as the spool
        self._starts = array("q")  # of blocks of so many
        self._size = in_memory
        self._newest: list[T] = []
        self._read: tuple[int, list[T]] = -1, []  # the last block that came back

    def append(self, thing: T) -> None:
        """Keep it; it is not to change any more."""
        self._newest.append(thing)
        if len(self._newest) == self._size:
            self._file.seek(0, 2)
            self._starts.append(self._file.tell())
            pickle.dump(self._newest, self._file, pickle.HIGHEST_PROTOCOL)
            self._newest = []

    def __len__(self) -> int:
        return len(self._starts) * self._size + len(self._newest)

    def __iter__(self) -> Iterator[T]:
        return (self[number] for number in range(len(self)))

    @overload
    def __getitem__(self, number: int) -> T: ...

    @overload
    def __getitem__(self, number: slice) -> list[T]: ...

    def __getitem__(self, number: int | slice) -> T | list[T]:
        if isinstance(number, slice):
            return [self[each] for each in range(len(self))[number]]
        block, place = divmod(range(len(self))[number], self._size)
        if block == len(self._starts):
            return self._newest[place]
        if block != self._read[0]:
            self._file.seek(self._starts[block])
            self._read = block, pickle.load(self._file)
        return self._read[1][place]


_IN_MEMORY = 512  # injections, some KB each


class StreamedEvaluation:
    """One file evaluated: its injections, in a temporary file; its samples pass by."""

    def __init__(self, source: SignalStream, curves_of: Coefficients | None = None) -> None:
        """curves_of: the nominal model, where curves of every injection are to be drawn."""
        self.path = source.path
        self.sample_rate = source.sample_rate
        self.has_rate = source.has_rate
        self.injections: Spool[InjectionResult] = Spool(_IN_MEMORY)
        self.curves: Spool[RateCurves] = Spool()
        """As many as injections, where they are kept."""
        self._source = source
        self._curves_of = curves_of
        self._held: InjectionResult | None = None  # until no measured mass can come for it
        self._writer: TableWriter | None = None

    @property
    def samples(self) -> int:
        """How many there are."""
        return self._source.samples

    def write_to(self, writer: TableWriter) -> None:
        """Write the trace."""
        self._writer = writer

    @property
    def wants_states(self) -> bool:
        """For the trace, and curves of the line."""
        return self._writer is not None or self._curves_of is not None

    def take_report(self, passage: Passage, report: InjectionReport) -> None:
        """An injection, whose samples the passage remembers."""
        self._let_go()
        self._held = injection_result(
            report,
            passage.first_index + passage.first,
            passage.time,
            passage.trace,
            passage.measured_rate,
            self.sample_rate,
            None,
        )
        if report.rate_sigma is not None:
            self._held = replace(self._held, report=replace(report, rate_sigma=None))
        if (c := self._curves_of) is not None:
            line_pressure = passage.line_pressure * c.pressure_scale + c.chamber_pressure
            first_index = passage.first_index + passage.first
            known = passage.time, passage.trace, passage.measured_rate
            self.curves.append(rate_curves(report, first_index, *known, line_pressure, c))

    def take_measured(self, measured: MeasuredMass) -> None:
        """Of the injection told last; a measured rate goes before it."""
        if (
            self._held is not None
            and self._held.report.number == measured.report.number
            and not self.has_rate
        ):
            self._held = replace(self._held, measured_mass=measured.mass)

    def take_passed(self, time: Signal, trace: Trace) -> None:
        """Into the trace."""
        if self._writer is not None:
            self._writer.write(trace_arrays(time.copy(), joined([trace])))

    def end(self, run: ObserverRun) -> None:
        """All its frames were taken."""
        self.counters: Counters = run.counters
        self.standstill: Standstill = run.standstill

    def finish(self, before: Counters, has_energizing: bool) -> None:
        """Nothing more will be heard; before: what was counted of the files before it."""
        self._let_go()
        self.counters = self.counters.since(before)
        self.has_energizing = has_energizing

    def _let_go(self) -> None:
        if self._held is not None:
            self.injections.append(self._held)
            self._held = None


def evaluate_stream(
    bench: Bench,
    sources: Sequence[SignalStream],
    traces: Sequence[Path] = (),
    knowledge: Knowledge | None = None,
    learning: bool = True,
    progress: Progress | None = None,
    curves_of: Coefficients | None = None,
    reads_ahead: bool = True,
) -> tuple[list[StreamedEvaluation], Knowledge]:
    """Evaluate files as one history: recordings, or logs whose sample index goes on from one to the next.

    traces: files to be written, of each, or none; curves_of: as of `StreamedEvaluation`; reads_ahead: as of
    `ObserverRun`. Else as `evaluate` and `evaluate_logs`.
    """
    is_logged = any(isinstance(source, LoggedSignals) for source in sources)
    bench = bench if is_logged else bench_for(bench, sources[0])
    fuel_temperature = None if is_logged else bench.injector.parameters.fluid.reference_temperature
    evaluations = [StreamedEvaluation(source, curves_of) for source in sources]
    with ExitStack() as stack:
        learner_of: LearnerFactory = make_learner
        if learning and reads_ahead:
            wait = stack.enter_context(learning_compiled_beside(bench.injector))
            learner_of = awaited(make_learner, wait)
        run = ObserverRun(
            bench, knowledge, learning, progress, learner_of, fuel_temperature, reads_ahead=reads_ahead
        )
        for path, evaluation in zip(traces, evaluations, strict=False):
            stack.enter_context(file_errors(path))
            evaluation.write_to(stack.enter_context(open_trace(path)))
        for source, evaluation in zip(sources, evaluations, strict=True):
            if isinstance(source, LoggedSignals):
                run.take_frames(source.frames, _passages(source, evaluation))
            else:
                run.take(source, evaluation)
            evaluation.end(run)
        run.finish()
    evaluations[-1].end(run)
    before = [
        evaluations[0].counters.since(evaluations[0].counters),
        *(each.counters for each in evaluations),
    ]
    for evaluation, counted in zip(evaluations, before, strict=False):
        evaluation.finish(counted, run.has_energizing)
    return evaluations, run.knowledge


def _passages(log: LoggedSignals, evaluation: StreamedEvaluation) -> list[Passage]:
    """Of a log, apart at long holes, which belong to what is before them; times go on over a restart."""
    passages, offset = [], 0
    for stretch in log.logged:
        bounds = [stretch.first_index, *stretch.resumed, stretch.last_index + 1]
        for first, end in pairwise(bounds):
            passages.append(Passage(evaluation, first, end - first, log.rate, offset))
            offset += end - first
    return passages
