"""`observer-rt evaluate`: recordings are examined, then evaluated one by one or as one history; files in and out."""

import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from rich.console import Console

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench
from observer_rt.daemon.lock import sole_writer
from observer_rt.daemon.state_file import model_hash, restored_knowledge, save_knowledge
from observer_rt.desk.evaluation.evaluate import bench_for_all, evaluate
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.desk.evaluation.logged import LoggedSignals, observer_runs, open_source, without_companions
from observer_rt.desk.evaluation.observer_run import Progress
from observer_rt.desk.evaluation.results import print_evaluation, write_document
from observer_rt.desk.evaluation.trace import SUFFIXES, TRACE_SUFFIX
from observer_rt.desk.injection_map.beside_map import beside_map, print_beside_map
from observer_rt.desk.injection_map.mass_map import read_map
from observer_rt.desk.recording_options import EvaluateOptions
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.service.injector import doubt_about_fit
from observer_rt.files.replay.framing import bench_for, clamped_in
from observer_rt.files.signals.doubts import doubts, refuse_dead
from observer_rt.files.signals.stream import SignalStream
from observer_rt.foundation.console import progress_bar, results, say
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import replacing
from observer_rt.foundation.outputs import FIGURE_SUFFIXES, LEARNED_STATE, check_output, make_folder
from observer_rt.model.effective import Coefficients
from observer_rt.model.parameters import InjectorParameters


def evaluate_files(bench: Bench, options: EvaluateOptions, console: Console) -> None:
    """Evaluate the recordings and write what the options ask for."""
    paths, stated = without_companions(options.recordings, console), bench.injector.parameters
    c, traces = bench.injector.coefficients, _traces(paths, options)
    _refuse_early(paths, traces, options)
    plan = None if options.map is None else read_map(options.map, stated.fluid.density_nozzle)
    knowledge = starting_knowledge("--state", options.state, stated, partial(say, console))
    sources = [open_source(path, bench, options.from_channel, console) for path in paths]
    look_over(bench, sources, console)
    with (
        ExitStack() as stack,
        progress_bar(console, "evaluating", sum(source.samples for source in sources)) as progress,
    ):
        evaluations, knowledge = evaluate_runs(
            bench,
            sources,
            knowledge,
            not options.no_learning,
            options.chain,
            progress,
            c if options.plot is not None else None,
            [stack.enter_context(replacing(path)) for path in traces],
        )
    if options.save_state is not None:
        write_state(options.save_state, knowledge, stated)
    points = None
    if plan is not None:
        injections = (injection for evaluation in evaluations for injection in evaluation.injections)
        points = beside_map(plan, injections, stated)
    if options.json:
        write_document(evaluations, model_hash(stated), c, sys.stdout, points)
    else:
        is_fitted = stated.baseline is not None and stated.baseline.adequate
        for evaluation in evaluations:
            print_evaluation(evaluation, c, results(), is_fitted)
        if points is not None:
            print_beside_map(points, results())
    if options.plot is not None:
        from observer_rt.desk.evaluation.figures import pictures_of, plot_injections

        plot_injections(options.plot, pictures_of(evaluations), "measured")


def _refuse_early(paths: Sequence[Path], traces: Sequence[Path], options: EvaluateOptions) -> None:
    """Raise `UserError`, before the long work, for options that do not fit, and files not to be written."""
    location = f"--output {options.output}"
    if len(paths) > 1 and options.output is not None and not options.has_folder:
        raise UserError(location, "names a file, but there are several recordings", "name a folder")
    if twice := [trace.name for trace in traces if traces.count(trace) > 1]:
        raise UserError(location, f"{twice[0]} would be written twice", "rename the recordings")
    if len(paths) > 1 and options.save_state is not None and not options.chain:
        raise UserError("--save-state", "needs one history, but the recordings are evaluated apart", "add --chain")
    inputs = {path.resolve() for path in paths}
    for option, path in options.written.items():
        if path.resolve() in inputs:
            raise UserError(f"{option} {path}", "is a recording to be evaluated", "name another file")
    if options.output is not None and options.has_folder:
        make_folder("--output", options.output)
    for trace in traces:
        check_output("--output", trace, options.force, suffixes=SUFFIXES)
    if options.plot is not None:
        check_output("--plot", options.plot, options.force, suffixes=FIGURE_SUFFIXES)
    if options.save_state is not None:
        check_output("--save-state", options.save_state, options.force, LEARNED_STATE)
        with sole_writer(options.save_state):
            pass  # no daemon keeps it


def _traces(paths: Sequence[Path], options: EvaluateOptions) -> list[Path]:
    if options.output is None or not options.has_folder:
        return [] if options.output is None else [options.output]
    return [options.output / (path.name + TRACE_SUFFIX) for path in paths]


def look_over(bench: Bench, sources: Sequence[SignalStream], console: Console) -> None:
    """Warn of odd recordings and doubts about the fit. Raises `UserError` for a wrong bench or a dead signal."""
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


def evaluate_runs(
    bench: Bench,
    sources: Sequence[SignalStream],
    knowledge: Knowledge | None,
    learning: bool,
    chain: bool,
    progress: Progress,
    curves_of: Coefficients | None,
    traces: Sequence[Path] | None = None,
) -> tuple[list[Evaluation], Knowledge]:
    """Evaluate every source by itself, or as one history (`chain`); returns the knowledge at the end, too.

    learning: unless the bench has it off; progress: takes samples done; curves_of, traces: as of `evaluate`. Raises
    `UserError` for a history of several sample rates.
    """
    runs = observer_runs(sources) if chain else [[source] for source in sources]
    if chain:
        bench_for_all(bench, sources)
    learning = learning and bench.injector.config.learning.enabled
    evaluations: list[Evaluation] = []
    current, done = knowledge, 0
    for run in runs:
        history = evaluate(
            bench,
            run,
            current if chain else knowledge,
            learning,
            partial(lambda before, samples: progress(before + samples), done),
            curves_of=curves_of,
            traces=None if traces is None else traces[len(evaluations) : len(evaluations) + len(run)],
        )
        evaluations += history.evaluations
        current = history.knowledge
        done += sum(source.samples for source in run)
    assert current is not None  # there is a run
    return evaluations, current


def starting_knowledge(
    location: str, path: Path | None, parameters: InjectorParameters, tell: Callable[[str], None]
) -> Knowledge | None:
    """Learned state that a user names, if any. Raises `UserError` at `location` if missing or of another model."""
    if path is not None and not path.exists():
        raise UserError(f"{location} {path}", "no such file", "correct the path, or leave it out")
    return restored_knowledge(path, parameters, tell, set_aside=False)


def write_state(path: Path, knowledge: Knowledge, parameters: InjectorParameters) -> None:
    """Write a learned state to a file that no daemon uses. Raises `UserError` or `RunError` where that cannot be."""
    with sole_writer(path):
        save_knowledge(path, knowledge, parameters)
