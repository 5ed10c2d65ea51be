"""Recordings and CAN logs through the daemon's core, part by part: only a trace that is kept needs more memory."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.desk.evaluation.logged import LoggedSignals
from observer_rt.desk.evaluation.observer_run import ObserverRun, Progress
from observer_rt.desk.evaluation.trace import open_trace
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.reports.learned_laws import learned_laws
from observer_rt.engine.reports.news import News
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.injector import LearnerFactory, make_learner
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.files.replay.framing import bench_for
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import HeldSignals, SignalStream
from observer_rt.foundation.errors import UserError, file_errors
from observer_rt.model.effective import Coefficients
from observer_rt.model.surroundings import Surroundings


class History(NamedTuple):
    """Recordings evaluated one after another by one observer, and what it knows at the end."""

    evaluations: tuple[Evaluation, ...]
    knowledge: Knowledge
    frames: tuple[OutputFrame, ...]


def evaluate(
    bench: Bench,
    recordings: Sequence[Recording | SignalStream],
    knowledge: Knowledge | None = None,
    learning: bool = True,
    progress: Progress = lambda _: None,
    learner_of: LearnerFactory = make_learner,
    curves_of: Coefficients | None = None,
    traces: Sequence[Path] | None = None,
) -> History:
    """Evaluate recordings as one history, learning in lockstep.

    All go through the bench's bus codec, so that the result equals the daemon's bit for bit. Between two recordings
    the sample index jumps, as between windows; that of a log must go on beyond that of the one before.  knowledge:
    learned before; progress: takes samples processed; learner_of: makes the learner; curves_of: as of `Evaluation`;
    traces: files to be written of the first recordings, None: traces, curves and frames stay in memory. A lift that
    fails is left out of all where all have commands. Raises `UserError` for another sample rate.
    """
    sources = [HeldSignals(recording) if isinstance(recording, Recording) else recording for recording in recordings]
    evaluations = [Evaluation(source, curves_of, traces is None) for source in sources]
    bench_as_given, bench = bench, bench_for_all(bench, sources)
    are_recordings = not any(isinstance(source, LoggedSignals) for source in sources)
    commanded = all("energizing" in source.optional for source in sources) if are_recordings else None
    bus, news = map_bus(bench), list[News]()
    with ExitStack() as stack:
        for path, evaluation in zip(traces or (), evaluations, strict=False):
            stack.enter_context(file_errors(path))
            evaluation.writer = stack.enter_context(open_trace(path))
        core = Core(
            bench.injector,
            bus if traces is None else replace(bus, rate=None),
            knowledge,
            learning=learning,
            listeners=[news.append],
            learner_of=learner_of,
            assumes_filed=are_recordings,  # for recordings know no surroundings
            writes_summaries=traces is None,
            commanded=commanded,
        )
        run, before = ObserverRun(core, bus, news, progress, keeps_frames=traces is None), core.counters
        for evaluation in evaluations:
            run.observe(evaluation.source, evaluation)
            if evaluation is evaluations[-1]:
                run.finish()
            evaluation.counters, evaluation.standstill = core.counters.since(before), core.standstill
            evaluation.has_energizing = core.optional.energizing is not None
            evaluation.learned = learned_laws(core.knowledge, core.coefficients)
            before = core.counters
    if not commanded or not any(evaluation.has_lost_lift for evaluation in evaluations):
        return History(tuple(evaluations), core.knowledge, tuple(run.frames))
    for source in sources:
        source.has_lift = False
    history = evaluate(bench_as_given, sources, knowledge, learning, progress, learner_of, curves_of, traces)
    for evaluation in history.evaluations:
        evaluation.lift_failed = True
    return history


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
    recorded = {name for source in sources for name in source.recorded} & {*Surroundings._fields}
    signals = benches[0].injector.config.signals.model_copy(update=dict.fromkeys(recorded))
    return benches[0].with_sections(signals=signals)
