"""Recordings in memory through the same core as the daemon, as fast as the machine allows."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from observer_rt.config.bench import Bench
from observer_rt.evaluation.curves import InjectionResult, injection_result
from observer_rt.evaluation.logged import LoggedRecording
from observer_rt.evaluation.passage import Passage
from observer_rt.evaluation.run import ObserverRun, Progress
from observer_rt.evaluation.trace import Signal, Trace, joined
from observer_rt.foundation.errors import UserError
from observer_rt.observer.learning.knowledge import Knowledge
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.recording.replay.framing import bench_for
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.stream import HeldSignals
from observer_rt.service.core.counters import Counters
from observer_rt.service.core.learners import LearnerFactory, make_learner
from observer_rt.service.core.messages import OutputFrame
from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.reports.news import MeasuredMass

__all__ = ["Evaluation", "History", "Trace", "evaluate", "evaluate_logs"]


@dataclass(frozen=True)
class Evaluation:
    """One recording evaluated.

    first_index: the sample index its first sample was sent with; measured: masses measured online, as a log of the
    bus has them; has_energizing: whether the bench has this input, so that reports and counters tell of commands.
    """

    recording: Recording
    first_index: int
    trace: Trace
    reports: tuple[InjectionReport, ...]
    counters: Counters
    standstill: Standstill
    measured: tuple[MeasuredMass, ...] = ()
    has_energizing: bool = False

    @property
    def path(self) -> Path | None:
        """Of the recording; the next are its, too."""
        return self.recording.path

    @property
    def samples(self) -> int:
        return self.recording.samples

    @property
    def sample_rate(self) -> float:
        return self.recording.sample_rate

    @property
    def has_rate(self) -> bool:
        return self.recording.injection_rate is not None

    @cached_property
    def injections(self) -> list[InjectionResult]:
        """Results of every injection, each over the window it was detected in."""
        online = {measured.report.number: measured.mass for measured in self.measured}
        return [
            injection_result(
                report,
                self.first_index,
                self.recording.time,
                self.trace,
                self.recording.injection_rate,
                self.recording.sample_rate,
                online.get(report.number),
            )
            for report in self.reports
        ]


@dataclass(frozen=True)
class History:
    """Recordings evaluated one after another by one observer, and what it knows at the end."""

    evaluations: tuple[Evaluation, ...]
    knowledge: Knowledge
    frames: tuple[OutputFrame, ...]


def evaluate(
    bench: Bench,
    recordings: Sequence[Recording],
    knowledge: Knowledge | None = None,
    learning: bool = True,
    progress: Progress | None = None,
    learner_of: LearnerFactory = make_learner,
) -> History:
    """Evaluate recordings as one history, learning in lockstep.

    Every recording goes through the bench's bus codec, so that the result equals that of the daemon bit for bit.
    Between two recordings the sample index jumps, as between two windows of a windowed source.
    Raises `UserError` for a recording whose sample rate is not the bench's.
    """
    bench = bench_for(bench, recordings[0])
    for recording in recordings[1:]:
        if bench_for(bench, recording).injector.config.sampling != bench.injector.config.sampling:
            raise UserError(
                str(recording.path),
                f"is sampled at {recording.sample_rate:g} Hz, {recordings[0].path} before it at "
                f"{recordings[0].sample_rate:g} Hz; or their samples differ in what they mean",
                "recordings of one history must be sampled alike",
            )
    fuel_temperature = bench.injector.parameters.fluid.reference_temperature  # a recording knows none
    run = ObserverRun(bench, knowledge, learning, progress, learner_of, fuel_temperature, keeps_frames=True)
    heard = []
    for recording in recordings:
        heard.append(_Heard(recording))
        passages = run.take(HeldSignals(recording), heard[-1])
        heard[-1].end(run, passages[0].first_index)
    return _history(run, heard)


def evaluate_logs(
    bench: Bench,
    logs: Sequence[LoggedRecording],
    knowledge: Knowledge | None = None,
    learning: bool = True,
    progress: Progress | None = None,
) -> History:
    """Evaluate the frames of CAN logs as they are, as the daemon would have on the bus; else as `evaluate`.

    The sample index of every log must go on beyond that of the one before.
    """
    run = ObserverRun(bench, knowledge, learning, progress, keeps_frames=True)
    heard = []
    for log in logs:
        heard.append(_Heard(log.recording))
        samples, rate = log.recording.samples, log.recording.sample_rate
        run.take_frames(log.frames, [Passage(heard[-1], log.first_index, samples, rate)])
        heard[-1].end(run, log.first_index)
    return _history(run, heard)


class _Heard:
    """What is heard of one recording."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._traces: list[Trace] = []
        self._reports: list[InjectionReport] = []
        self._measured: list[MeasuredMass] = []

    @property
    def wants_states(self) -> bool:
        """Of the trace."""
        return True

    def take_report(self, passage: Passage, report: InjectionReport) -> None:
        self._reports.append(report)

    def take_measured(self, measured: MeasuredMass) -> None:
        self._measured.append(measured)

    def take_passed(self, time: Signal, trace: Trace) -> None:
        self._traces.append(joined([trace]))

    def end(self, run: ObserverRun, first_index: int) -> None:
        """All its frames were taken."""
        self.first_index = first_index
        self.counters, self.standstill = run.counters, run.standstill

    def evaluation(self, before: Counters, has_energizing: bool) -> Evaluation:
        """All that was heard; before: what was counted of the recordings before it."""
        return Evaluation(
            self._recording,
            self.first_index,
            joined(self._traces),
            tuple(self._reports),
            self.counters.since(before),
            self.standstill,
            tuple(self._measured),
            has_energizing,
        )


def _history(run: ObserverRun, heard: Sequence[_Heard]) -> History:
    run.finish()
    heard[-1].end(run, heard[-1].first_index)
    before = [heard[0].counters.since(heard[0].counters), *(each.counters for each in heard)]
    evaluations = (
        each.evaluation(counters, run.has_energizing) for each, counters in zip(heard, before, strict=False)
    )
    return History(tuple(evaluations), run.knowledge, tuple(run.frames))
