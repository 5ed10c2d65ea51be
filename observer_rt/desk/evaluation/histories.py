"""Examines recordings, and evaluates them one by one or as one history; writes the learned state."""

from collections.abc import Callable, Sequence
from itertools import islice
from pathlib import Path

from rich.console import Console

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench
from observer_rt.daemon.keeper import sole_writer
from observer_rt.daemon.state_file import restored_knowledge, save_knowledge
from observer_rt.desk.evaluation.evaluate import Evaluation, bench_for_all, evaluate
from observer_rt.desk.evaluation.logged import LoggedSignals, in_runs
from observer_rt.desk.evaluation.run import Progress
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.service.injector import doubt_about_fit
from observer_rt.files.replay.framing import bench_for, clamped_in
from observer_rt.files.signals.doubts import doubts, refuse_dead
from observer_rt.files.signals.stream import SignalStream
from observer_rt.foundation.console import say
from observer_rt.foundation.errors import UserError
from observer_rt.model.effective import Coefficients
from observer_rt.model.parameters import InjectorParameters


def look_over(bench: Bench, sources: Sequence[SignalStream], console: Console) -> None:
    """Warn of oddities in recordings and of doubts about the model's fit, before any evaluation.

    Raises `UserError` for a recording that does not match the bench, or has a dead signal.
    """
    benches = [bench_for(bench, source) for source in sources]
    for doubt in dict.fromkeys(doubt_about_fit(own.injector) for own in benches):
        if doubt is not None:
            say(console, f"warning: {doubt.text}\n  remedy: {doubt.remedy}")
    for source in sources:
        is_log = isinstance(source, LoggedSignals)
        if not is_log:
            refuse_dead(source.path, source.survey, source.names)
        for odd in doubts(source.survey, bench.injector.parameters.baseline, source.names):
            say(console, odd.as_text(source.path))
        for warning in () if is_log else clamped_in(source.survey, map_bus(bench)):
            say(console, f"warning: {source.path}, {warning}")


def run_by_run(
    bench: Bench,
    sources: Sequence[SignalStream],
    knowledge: Knowledge | None,
    learning: bool,
    chain: bool,
    progress: Progress,
    curves_of: Coefficients | None,
    traces: Sequence[Path] | None = None,
) -> tuple[list[Evaluation], Knowledge]:
    """Evaluate every source by itself, or all of them as one history, in which knowledge goes on from run to run.

    learning: unless the bench has it off; progress: gets the number of samples done;
    curves_of, traces: as of `evaluate`.
    Also returns the knowledge at the end of the last run. Raises `UserError` for a history of several sample rates.
    """
    runs = in_runs(sources) if chain else [[source] for source in sources]
    if chain:
        bench_for_all(bench, sources)
    learning = learning and bench.injector.config.learning.enabled
    remaining = None if traces is None else iter(traces)
    evaluations: list[Evaluation] = []
    current, done = knowledge, 0
    for run in runs:

        def report(samples: int, before: int = done) -> None:
            progress(before + samples)

        history = evaluate(
            bench,
            run,
            current if chain else knowledge,
            learning,
            report,
            curves_of=curves_of,
            traces=None if remaining is None else list(islice(remaining, len(run))),
        )
        evaluations += history.evaluations
        current = history.knowledge
        done += sum(source.samples for source in run)
    assert current is not None  # there is a run
    return evaluations, current


def begun_with(
    location: str, path: Path | None, parameters: InjectorParameters, tell: Callable[[str], None]
) -> Knowledge | None:
    """Learned state that a user names, with a message of what became of it; None without one.

    Raises `UserError` at `location` for one that is not there, and for one of another model.
    """
    if path is not None and not path.exists():
        raise UserError(f"{location} {path}", "no such file", "correct the path, or leave it out")
    return restored_knowledge(path, parameters, tell, set_aside=False)


def write_state(path: Path, knowledge: Knowledge, parameters: InjectorParameters) -> None:
    """Write the learned state of a model. No daemon may be using the file.

    Raises `UserError`, `RunError` where it cannot be written.
    """
    with sole_writer(path):
        save_knowledge(path, knowledge, parameters)
