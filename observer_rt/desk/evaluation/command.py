"""`observer-rt evaluate`: files in, table, JSON, trace and figure out."""

import sys
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import Bench
from observer_rt.daemon.keeper import sole_writer
from observer_rt.daemon.state_file import model_hash
from observer_rt.desk.evaluation.histories import begun_with, look_over, run_by_run, write_state
from observer_rt.desk.evaluation.logged import open_source, without_truths
from observer_rt.desk.evaluation.results import print_evaluation, write_document
from observer_rt.desk.evaluation.trace import SUFFIXES, TRACE_SUFFIX
from observer_rt.desk.recording_options import EvaluateOptions
from observer_rt.foundation.console import FIGURE_SUFFIXES, results, say
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import LEARNED_STATE
from observer_rt.foundation.outputs import check_output, make_folder, replacing
from observer_rt.foundation.progress import progress_bar


def evaluate_files(bench: Bench, options: EvaluateOptions, console: Console) -> None:
    """Evaluate the recordings and write what the options ask for."""
    paths, stated = without_truths(options.recordings, console), bench.injector.parameters
    c, traces = bench.injector.coefficients, _traces(paths, options)
    _refuse_early(paths, traces, options)
    knowledge = begun_with("--state", options.state, stated, partial(say, console))
    sources = [open_source(path, bench, options.from_channel, console) for path in paths]
    look_over(bench, sources, console)
    with (
        ExitStack() as stack,
        progress_bar(console, "evaluating", sum(source.samples for source in sources)) as progress,
    ):
        evaluations, knowledge = run_by_run(
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
    if options.json:
        write_document(evaluations, model_hash(stated), c, sys.stdout)
    else:
        is_fitted = stated.baseline is not None and stated.baseline.adequate
        for evaluation in evaluations:
            print_evaluation(evaluation, c, results(), is_fitted)
    if options.plot is not None:
        from observer_rt.desk.evaluation.figures import pictures_of, plot_injections

        plot_injections(options.plot, pictures_of(evaluations), "measured")


def _refuse_early(paths: Sequence[Path], traces: Sequence[Path], options: EvaluateOptions) -> None:
    """Raise `UserError`, before the long work, for options that do not fit together, and for files that could not be
    written after it, or would replace one that nobody named.
    """
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
    """To be written, one a recording, or none."""
    if options.output is None or not options.has_folder:
        return [] if options.output is None else [options.output]
    return [options.output / (path.name + TRACE_SUFFIX) for path in paths]
