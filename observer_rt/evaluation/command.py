"""`observer-rt evaluate`: files in, table, JSON, trace and figure out."""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from observer_rt.config import Bench
from observer_rt.errors import UserError
from observer_rt.evaluation.evaluate import Evaluation, History, evaluate
from observer_rt.evaluation.results import SCHEMA, InjectionResult, injection_results, recording_json
from observer_rt.evaluation.trace_file import SUFFIX, write_trace
from observer_rt.model.coefficients import Coefficients, coefficients
from observer_rt.observer.learning import Knowledge
from observer_rt.recording.files import file_errors, read_recording
from observer_rt.recording.framing import bench_for
from observer_rt.recording.recording import Recording
from observer_rt.screen import progress_bar, results
from observer_rt.service.main import restored_knowledge
from observer_rt.service.state_file import model_hash, save_knowledge
from observer_rt.units import MEGAPASCAL, MILLIGRAM, MM3_PER_MS


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


def evaluate_files(bench: Bench, paths: Sequence[Path], options: EvaluateOptions, console: Console) -> None:
    """Evaluate the recordings and write what the options ask for."""
    _refuse_ambiguous(paths, options)
    recordings = [read_recording(path) for path in paths]
    model = model_hash(bench.injector)
    pressure_scale = bench.injector.scaling.pressure
    knowledge = restored_knowledge(options.state, model, pressure_scale, console)
    histories = _histories(bench, recordings, knowledge, options, console)
    evaluations = [evaluation for history in histories for evaluation in history.evaluations]
    c = coefficients(bench.injector)
    if options.save_state is not None:
        save_knowledge(options.save_state, histories[-1].knowledge, model, pressure_scale)
    if options.output is not None:
        _write_traces(options.output, evaluations)
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
            results_console.print(_table(evaluation, injection_results(evaluation, c)))


def _refuse_ambiguous(paths: Sequence[Path], options: EvaluateOptions) -> None:
    if len(paths) > 1 and options.output is not None and options.output.suffix:
        raise UserError(
            f"--output {options.output}", "names a file, but there are several recordings", "name a folder"
        )
    if len(paths) > 1 and options.plot is not None:
        raise UserError(
            "--plot", "makes one figure, but there are several recordings", "evaluate one of them"
        )
    if len(paths) > 1 and options.save_state is not None and not options.chain:
        raise UserError(
            "--save-state", "needs one history, but the recordings are evaluated apart", "add --chain"
        )


def _histories(
    bench: Bench,
    recordings: Sequence[Recording],
    knowledge: Knowledge | None,
    options: EvaluateOptions,
    console: Console,
) -> list[History]:
    groups = [list(recordings)] if options.chain else [[recording] for recording in recordings]
    for recording in recordings:
        bench_for(bench, recording)  # refuse before the first one is evaluated
    total = sum(recording.samples for recording in recordings)
    done = 0
    histories = []
    with progress_bar(console, "evaluating", total) as progress:
        for group in groups:
            report = partial(_report_progress, progress, done)
            histories.append(evaluate(bench, group, knowledge, options.learning, report))
            done += sum(recording.samples for recording in group)
    return histories


def _report_progress(progress: Callable[[float], None], before: int, samples: int) -> None:
    progress(before + samples)


def _write_traces(output: Path, evaluations: Sequence[Evaluation]) -> None:
    if output.suffix and not output.is_dir():
        write_trace(output, evaluations[0])
        return
    with file_errors(output):
        output.mkdir(parents=True, exist_ok=True)
    for evaluation in evaluations:
        write_trace(output / (Path(evaluation.recording.path or "recording").name + SUFFIX), evaluation)


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


def _table(evaluation: Evaluation, injections: Sequence[InjectionResult]) -> Table:
    recording = evaluation.recording
    counters = evaluation.counters
    table = Table(
        title=f"{recording.path}: {recording.samples} samples at {recording.sample_rate:g} Hz, "
        f"{counters.lost_samples} lost; {counters.adoptions} phi adopted, {counters.rejected_adoptions} rejected",
        title_justify="left",
        box=None,
    )
    measured = recording.injection_rate is not None
    headings = ["injection", "event", "start [s]", "rail [MPa]", "mass [mg]", "nominal [mg]"]
    if measured:
        headings += ["measured [mg]", "error [%]", "RMSE [mm3/ms]"]
    for heading in [*headings, "v_H [-]", "v_S [-]", "state", "valid"]:
        table.add_column(Text(heading), justify="right", no_wrap=True)
    for result in injections:
        report = result.report
        cells = [
            str(report.number),
            str(report.event),
            f"{result.start:.4f}",
            f"{report.rail_pressure / MEGAPASCAL:.1f}",
            _number(report.mass / MILLIGRAM),
            _number(result.nominal_mass / MILLIGRAM),
        ]
        if measured:
            cells += [
                _number(result.measured_mass / MILLIGRAM),
                _number(100 * (report.mass / result.measured_mass - 1)),
                _number(result.rate_rmse / MM3_PER_MS),
            ]
        cells += [
            f"{report.indicators.nozzle.value:+.3f}",
            f"{report.indicators.seat.value:+.3f}",
            report.state.name,
            "yes" if report.valid else report.reason.name,
        ]
        table.add_row(*cells)
    return table


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.2f}"
