"""`observer-rt evaluate`: files in, table, JSON, trace and figure out."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rich.console import Console

from observer_rt.config import Bench
from observer_rt.destinations import FIGURE_SUFFIXES, check_destination, check_folder
from observer_rt.errors import UserError
from observer_rt.evaluation.evaluate import Evaluation, History, evaluate, evaluate_log
from observer_rt.evaluation.logged import LoggedRecording, read_logged
from observer_rt.evaluation.results import SCHEMA, injection_results, recording_json
from observer_rt.evaluation.table import print_evaluation
from observer_rt.evaluation.trace_file import SUFFIX, write_trace
from observer_rt.model.coefficients import Coefficients
from observer_rt.model.effects import effective_model
from observer_rt.observer.knowledge import Knowledge
from observer_rt.recording.files import READERS, file_errors, read_recording
from observer_rt.recording.framing import bench_for
from observer_rt.recording.logs import LOG_READERS, is_log
from observer_rt.recording.recording import Recording
from observer_rt.screen import progress_bar, results, say, say_if_compiling
from observer_rt.service.learners import refuse_state
from observer_rt.service.main import restored_knowledge
from observer_rt.service.state_file import model_hash, save_knowledge


@dataclass(frozen=True)
class EvaluateOptions:
    """Options of the command."""

    state: Path | None
    save_state: Path | None
    learning: bool
    chain: bool
    output: Path | None
    plot: Path | None
    json: bool
    from_channel: Sequence[str] = ()
    """Channels of a CAN log, of buses."""


def evaluate_files(bench: Bench, paths: Sequence[Path], options: EvaluateOptions, console: Console) -> None:
    """Evaluate the recordings and write what the options ask for."""
    _refuse_ambiguous(paths, options)
    for option, path in (("--state", options.state), ("--save-state", options.save_state)):
        if path is not None:
            refuse_state(bench, option)
    _check_destinations(paths, options)
    say_if_compiling(console)
    recordings = [_read(bench, path, options, console) for path in paths]
    model = model_hash(bench.injector)
    pressure_scale = bench.injector.scaling.pressure
    if options.state is not None and not options.state.exists():
        raise UserError(f"--state {options.state}", "no such file", "correct the path, or leave it out")
    knowledge = restored_knowledge(options.state, model, pressure_scale, console, set_aside=False)
    histories = _histories(bench, recordings, knowledge, options, console)
    evaluations = [evaluation for history in histories for evaluation in history.evaluations]
    c = effective_model(bench.injector).coefficients
    if options.save_state is not None:
        save_knowledge(options.save_state, histories[-1].knowledge, model, pressure_scale)
    if options.output is not None:
        _write_traces(options.output, paths, evaluations)
    if options.plot is not None:
        _plot(options.plot, evaluations, c)
    if options.json:
        document = {
            "schema": SCHEMA,
            "model_sha256": model,
            "recordings": [recording_json(evaluation, c) for evaluation in evaluations],
        }
        print(json.dumps(document, indent=2))
    else:
        results_console = results()
        for evaluation in evaluations:
            print_evaluation(evaluation, c, results_console)


def _read(
    bench: Bench, path: Path, options: EvaluateOptions, console: Console
) -> Recording | LoggedRecording:
    suffix = path.suffix.lower()
    if suffix not in READERS and suffix not in LOG_READERS:
        known = ", ".join({**READERS, **LOG_READERS})
        raise UserError(str(path), f"unknown kind of recording '{path.suffix}'", f"known suffixes: {known}")
    if not is_log(path):
        return read_recording(path)
    if options.chain:
        raise UserError(
            f"--chain {path}",
            "is a CAN log, whose frames carry their own sample index",
            "convert the logs first: observer-rt convert LOG recording.csv --bench bench.toml",
        )
    with progress_bar(console, f"decoding {path.name}", 1.0) as progress:
        logged = read_logged(bench, path, options.from_channel, progress)
    for note in logged.notes:
        say(console, note)
    return logged


def _refuse_ambiguous(paths: Sequence[Path], options: EvaluateOptions) -> None:
    if len(paths) == 1:
        return
    if options.output is not None:
        if not _is_folder(options.output):
            raise UserError(
                f"--output {options.output}",
                "names a file, but there are several recordings",
                "name a folder",
            )
        traces = [_trace_in(options.output, path) for path in paths]
        twice = next((trace for trace in traces if traces.count(trace) > 1), None)
        if twice is not None:
            raise UserError(
                f"--output {options.output}", f"{twice.name} would be written twice", "rename the recordings"
            )
    if options.plot is not None:
        raise UserError(
            "--plot", "makes one figure, but there are several recordings", "evaluate one of them"
        )
    if options.save_state is not None and not options.chain:
        raise UserError(
            "--save-state", "needs one history, but the recordings are evaluated apart", "add --chain"
        )


def _check_destinations(paths: Sequence[Path], options: EvaluateOptions) -> None:
    """Refuse, before the long work, what could not be written after it."""
    if options.output is not None and _is_folder(options.output):
        with file_errors(options.output):
            options.output.mkdir(parents=True, exist_ok=True)
        check_folder("--output", options.output)
    elif options.output is not None:
        check_destination("--output", options.output)
    if options.plot is not None:
        check_destination("--plot", options.plot, FIGURE_SUFFIXES)
    if options.save_state is not None:
        check_destination("--save-state", options.save_state)
        check_folder("--save-state", options.save_state.absolute().parent)
    inputs = {path.resolve() for path in paths}
    for option, path in (
        ("--output", options.output),
        ("--plot", options.plot),
        ("--save-state", options.save_state),
    ):
        if path is not None and path.resolve() in inputs:
            raise UserError(f"{option} {path}", "is a recording to be evaluated", "name another file")


def _is_folder(output: Path) -> bool:
    return output.is_dir() or not (output.suffix or output.exists())


def _trace_in(folder: Path, recording: Path) -> Path:
    return folder / (recording.name + SUFFIX)


def _histories(
    bench: Bench,
    sources: Sequence[Recording | LoggedRecording],
    knowledge: Knowledge | None,
    options: EvaluateOptions,
    console: Console,
) -> list[History]:
    recordings = [s.recording if isinstance(s, LoggedRecording) else s for s in sources]
    for recording in recordings:
        bench_for(bench, recording)  # refuse before the first one is evaluated
    total = sum(recording.samples for recording in recordings)
    done = 0
    histories = []
    learning = options.learning and bench.config.learning.enabled
    with progress_bar(console, "evaluating", total) as progress:
        if options.chain:
            return [evaluate(bench, recordings, knowledge, learning, partial(_report_progress, progress, 0))]
        for source, recording in zip(sources, recordings, strict=True):
            report = partial(_report_progress, progress, done)
            if isinstance(source, LoggedRecording):
                histories.append(evaluate_log(bench, source, knowledge, learning, report))
            else:
                histories.append(evaluate(bench, [source], knowledge, learning, report))
            done += recording.samples
    return histories


def _report_progress(progress: Callable[[float], None], before: int, samples: int) -> None:
    progress(before + samples)


def _write_traces(output: Path, paths: Sequence[Path], evaluations: Sequence[Evaluation]) -> None:
    for path, evaluation in zip(paths, evaluations, strict=True):
        write_trace(_trace_in(output, path) if _is_folder(output) else output, evaluation)


def _plot(path: Path, evaluations: Sequence[Evaluation], c: Coefficients) -> None:
    from observer_rt.evaluation.figures import evaluation_curves, evaluation_masses, plot_injections

    evaluation = evaluations[0]
    injections = injection_results(evaluation, c)
    with file_errors(path):
        plot_injections(
            path,
            f"{evaluation.recording.path}",
            evaluation_curves(evaluation, injections),
            evaluation_masses(injections),
            "measured",
        )
