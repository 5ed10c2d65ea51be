"""`observer-rt evaluate`: files in, table, JSON, trace and figure out."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import Bench
from observer_rt.evaluation.evaluate import Evaluation, History, Progress, evaluate, evaluate_logs
from observer_rt.evaluation.logged import LoggedRecording
from observer_rt.evaluation.results import SCHEMA, injection_results, recording_json
from observer_rt.evaluation.sources import Source, in_runs, read_source, signals_of
from observer_rt.evaluation.table import print_evaluation
from observer_rt.evaluation.trace_file import SUFFIX, write_trace
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.file_errors import file_errors
from observer_rt.model.coefficients import Coefficients
from observer_rt.model.effects import effective_model
from observer_rt.model.fuel import temperature_of
from observer_rt.observer.learning.knowledge import Knowledge
from observer_rt.recording.replay.framing import bench_for
from observer_rt.service.compiled.constants import injector_at
from observer_rt.service.core.learners import refuse_state
from observer_rt.service.keeping.lock import sole_writer
from observer_rt.service.run import restored_knowledge
from observer_rt.service.state_file import model_hash, save_knowledge
from observer_rt.terminal.console import progress_bar, results, say, say_if_compiling
from observer_rt.terminal.destinations import FIGURE_SUFFIXES, check_destination, check_folder


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
    fuel_temperature: float | None = None
    """degC of recordings, which know none; None: as in the injector file."""


def evaluate_files(bench: Bench, paths: Sequence[Path], options: EvaluateOptions, console: Console) -> None:
    """Evaluate the recordings and write what the options ask for."""
    _refuse_ambiguous(paths, options)
    for option, path in (("--state", options.state), ("--save-state", options.save_state)):
        if path is not None:
            refuse_state(bench.injector, option)
    _check_destinations(paths, options)
    recordings = [read_source(path, bench, options.from_channel, console) for path in paths]
    say_if_compiling(console)
    model = model_hash(bench.injector.parameters)
    bench = _with_fuel(bench, recordings, options)
    pressure_scale = bench.injector.parameters.scaling.pressure
    if options.state is not None and not options.state.exists():
        raise UserError(f"--state {options.state}", "no such file", "correct the path, or leave it out")
    knowledge = restored_knowledge(
        options.state, model, pressure_scale, partial(say, console), set_aside=False
    )
    histories = _histories(bench, recordings, knowledge, options, console)
    evaluations = [evaluation for history in histories for evaluation in history.evaluations]
    c = effective_model(bench.injector.parameters).coefficients
    if options.save_state is not None:
        with sole_writer(options.save_state):
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


def _with_fuel(bench: Bench, sources: Sequence[Source], options: EvaluateOptions) -> Bench:
    """The bench with its fuel as warm as the options say."""
    if options.fuel_temperature is None:
        return bench
    is_told = bench.injector.config.signals.fuel_temperature is not None
    if is_told and any(isinstance(source, LoggedRecording) for source in sources):
        raise UserError(
            "--fuel-temperature",
            "is for recordings; a log tells it by signals.fuel_temperature of the bench file",
            "leave it out",
        )
    temperature = temperature_of("--fuel-temperature", options.fuel_temperature)
    return bench.with_parameters(injector_at(bench.injector, temperature))


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
        with sole_writer(options.save_state):
            pass  # no daemon keeps it
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
    sources: Sequence[Source],
    knowledge: Knowledge | None,
    options: EvaluateOptions,
    console: Console,
) -> list[History]:
    """Every source by itself, or all of them as one history, in which knowledge goes on from run to run."""
    recordings = [signals_of(source) for source in sources]
    for recording in recordings:
        bench_for(bench, recording)  # refuse before the first one is evaluated
    learning = options.learning and bench.injector.config.learning.enabled
    runs = in_runs(sources) if options.chain else [[source] for source in sources]
    done = 0
    histories: list[History] = []
    with progress_bar(console, "evaluating", sum(recording.samples for recording in recordings)) as progress:
        for run in runs:
            if options.chain and histories:
                knowledge = histories[-1].knowledge
            histories.append(
                _history(bench, run, knowledge, learning, partial(_report_progress, progress, done))
            )
            done += sum(signals_of(source).samples for source in run)
    return histories


def _history(
    bench: Bench,
    run: Sequence[Source],
    knowledge: Knowledge | None,
    learning: bool,
    report: Progress,
) -> History:
    logs = [source for source in run if isinstance(source, LoggedRecording)]
    if logs:
        return evaluate_logs(bench, logs, knowledge, learning, report)
    return evaluate(bench, [signals_of(source) for source in run], knowledge, learning, report)


def _report_progress(progress: Callable[[float], None], before: int, samples: int) -> None:
    progress(before + samples)


def _write_traces(output: Path, paths: Sequence[Path], evaluations: Sequence[Evaluation]) -> None:
    for path, evaluation in zip(paths, evaluations, strict=True):
        write_trace(_trace_in(output, path) if _is_folder(output) else output, evaluation)


def _plot(path: Path, evaluations: Sequence[Evaluation], c: Coefficients) -> None:
    from observer_rt.evaluation.figures import evaluation_curves, evaluation_masses, plot_injections

    evaluation = evaluations[0]
    injections = injection_results(evaluation)
    with file_errors(path):
        plot_injections(
            path,
            f"{evaluation.recording.path}",
            evaluation_curves(evaluation, injections),
            evaluation_masses(injections),
            "measured",
        )
