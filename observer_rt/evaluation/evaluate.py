"""Recordings in memory through the same core as the daemon; what a user names as one, files and CAN logs."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby, pairwise
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import Bench
from observer_rt.evaluation.curves import InjectionResult, injection_result
from observer_rt.evaluation.logged import LoggedRecording, LoggedSignals
from observer_rt.evaluation.passage import Passage
from observer_rt.evaluation.run import ObserverRun, Progress
from observer_rt.evaluation.trace import Signal, Trace, joined
from observer_rt.foundation.errors import UserError
from observer_rt.observer.learning.knowledge import Knowledge
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.recording.formats import is_log, open_recording
from observer_rt.recording.replay.framing import bench_for
from observer_rt.recording.signals.plausible import refuse_implausible
from observer_rt.recording.signals.recording import TRUTH_SUFFIX, Recording
from observer_rt.recording.signals.stream import HeldSignals, SignalStream
from observer_rt.service.core.learners import LearnerFactory, make_learner
from observer_rt.service.core.messages import Counters, OutputFrame
from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.reports.news import MeasuredMass
from observer_rt.terminal.compiling import show_compiling
from observer_rt.terminal.console import progress_bar, say

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


def open_source(
    path: Path,
    bench: Bench | None,
    from_channels: Sequence[str],
    console: Console,
    in_one_go: bool = False,
) -> SignalStream:
    """Look through a file; what is odd about it is said. from_channels: of a log, as `--from-channel` names them.

    in_one_go: as of `open_recording`; `refuse_implausible` is then for whoever has read it.

    Raises `UserError` for an unknown suffix, a file that will not do, signals that are no injector's, and a log
    without a bench file.
    """
    if not is_log(path):
        with progress_bar(console, f"looking through {path.name}", None):
            source = open_recording(path, None if bench is None else bench.injector, in_one_go)
    elif bench is None:
        raise UserError(
            "--bench", f"is missing: it says which signals the frames of {path} carry", "name a bench file"
        )
    else:
        show_compiling(console)
        with progress_bar(console, f"decoding {path.name}", 1.0) as progress:
            source = LoggedSignals(bench, path, from_channels, progress)
    if not in_one_go:
        refuse_implausible(path, source.survey, source.names)
    for note in source.notes:
        say(console, note)
    return source


def without_truths(paths: Sequence[Path], console: Console) -> list[Path]:
    """The files without the truths beside simulated recordings, which `*.csv` catches, too."""
    kept = [path for path in paths if not path.name.endswith(TRUTH_SUFFIX)]
    if kept and len(kept) < len(paths):
        say(
            console,
            f"left out: {len(paths) - len(kept)} files {TRUTH_SUFFIX[1:]}, which are not for the observer",
        )
    return kept or list(paths)


def in_runs(sources: Sequence[SignalStream]) -> list[Sequence[SignalStream]]:
    """Sources of one history, apart where one observer could not go on: an observer is a run.

    Recordings are sent by a device of our own, one after another. A log goes on from that before it where its first
    sample index lies beyond the other's last, as in files a recorder began anew; else the device was restarted.
    """
    number = 0
    numbers = [0] * len(sources[:1])
    for before, after in pairwise(sources):
        number += not _goes_on(before, after)
        numbers.append(number)
    numbered = groupby(zip(numbers, sources, strict=True), key=lambda pair: pair[0])
    return [[source for _, source in pairs] for _, pairs in numbered]


def _goes_on(before: SignalStream, after: SignalStream) -> bool:
    if isinstance(before, LoggedSignals) and isinstance(after, LoggedSignals):
        return after.logged[0].first_index > before.logged[-1].last_index
    return not isinstance(before, LoggedSignals) and not isinstance(after, LoggedSignals)
