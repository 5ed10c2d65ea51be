"""Commands that make a model, and put it into force: `fit`, `discover`, `effects` and `take-over`."""

import sys
import time
from dataclasses import replace
from json import dumps
from pathlib import Path
from typing import Annotated

from observer_rt.config.bench import load_bench, load_injector
from observer_rt.config.effects import effect_named, effects_named
from observer_rt.config.injector_file import InjectorFile
from observer_rt.desk.cli.command import decoder_of, messages
from observer_rt.desk.recording_options import Recordings
from observer_rt.foundation.console import progress_bar, results, say
from observer_rt.foundation.errors import InterruptionError, UserError, require
from observer_rt.foundation.options import Argument, Decoder, Force, FromChannel, Injector, Json, Option
from observer_rt.foundation.outputs import FIGURE_SUFFIXES, check_output, make_folder
from observer_rt.model.parameters import InjectorParameters


def fit(
    model: Annotated[Path, Option("Injector file to start from: geometry right, the rest within a factor of two.")],
    output: Annotated[Path, Option("Fitted injector file to write.")],
    recordings: Recordings = (),
    map: Annotated[
        Path | None,
        Option(
            "Instead of recordings: masses by rail pressure and energizing time (CSV: "
            "rail_pressure_MPa,energizing_ms,mass_mg[,sigma_mg][,back_pressure_MPa])."
        ),
    ] = None,
    mass: Annotated[
        Path | None,
        Option(
            "Measured masses (CSV: recording[,injection],mass_mg|rate_file[,sigma_mg]), which fix the absolute level."
        ),
    ] = None,
    plot: Annotated[Path | None, Option("Figure (png, svg, pdf): line pressure and residuals, or masses.")] = None,
    force: Force = False,
    bench: Decoder = None,
    from_channel: FromChannel = (),
    injector: Injector = None,
    json: Json = False,
) -> None:
    """Calibrate the model, its structure included, to recordings of the healthy injector, or to a map of masses."""
    from observer_rt.desk.evaluation.logged import without_companions
    from observer_rt.desk.identification_inputs import measured_files
    from observer_rt.desk.library.fit import fitted_model, weighed_masses
    from observer_rt.engine.service.injector import calibration_of
    from observer_rt.identification.fit.fitted_file import write_fitted
    from observer_rt.identification.fit.report import draw_fit, print_fit
    from observer_rt.identification.fit.suitability import warnings
    from observer_rt.identification.likelihood.excerpts import MOST_SAMPLES
    from observer_rt.identification.likelihood.reading import coverage, hashes, without_copies

    if (map is None) == (not recordings):
        problem = "is missing" if map is None else "and --map are two sources"
        raise UserError("RECORDING", problem, "give recordings, or a map of masses by --map")
    decoder = decoder_of(bench, injector, model)
    start, source = load_injector(model), InjectorFile.read(model)
    if output.resolve() == model.resolve():
        raise UserError(f"--output {output}", "is the model that is fitted", "name another file, to compare the two")
    for name, path, suffixes in (("--output", output, (".toml",)), ("--plot", plot, FIGURE_SUFFIXES)):
        if path is not None:
            check_output(name, path, force, suffixes=suffixes)
    if map is not None:
        _fit_map(map, start, source, output, plot, json)
        return
    paths = without_copies(without_companions(recordings, messages), messages)
    most = MOST_SAMPLES if mass is None else sys.maxsize  # whole: masses go by all injections
    measured = measured_files(paths, start, decoder, from_channel, messages, most)
    weighed = weighed_masses(measured, mass, start)
    for line in (*(coverage(of) for of in measured), *(f"warning: {warning}" for warning in warnings(measured))):
        say(messages, line)
    with progress_bar(messages, "fitting", 1.0) as progress:
        try:
            sensors = calibration_of((decoder or load_bench(model=model)).injector)
            fitted = fitted_model(start, measured, weighed, hashes(paths), progress, sensors)
        except KeyboardInterrupt:
            raise InterruptionError("interrupted; nothing was written") from None
    write_fitted(output, source, fitted.done, fitted.baseline)
    if plot is not None:
        draw_fit(plot, fitted.done)
    if json:
        print(dumps(fitted.document.as_json(), indent=2))
    else:
        print_fit(fitted.document, results())
    say(messages, f"{output}: written" + ("" if plot is None else f"; {plot}: figure"))


def _fit_map(
    path: Path, start: InjectorParameters, source: InjectorFile, output: Path, plot: Path | None, json: bool
) -> None:
    """Calibrate nozzle, back pressure and needle to a map of masses."""
    from observer_rt.desk.injection_map.map_document import document_of, write_map_fit
    from observer_rt.desk.injection_map.map_fit import FEWEST_POINTS, fit_map
    from observer_rt.desk.injection_map.map_report import draw_map_fit, print_map_fit
    from observer_rt.desk.injection_map.mass_map import read_map

    of = read_map(path, start.fluid.density_nozzle, FEWEST_POINTS)
    with progress_bar(messages, "fitting", 1.0) as progress:
        try:
            done = fit_map(start, of, progress)
        except KeyboardInterrupt:
            raise InterruptionError("interrupted; nothing was written") from None
    write_map_fit(output, source, done)
    if plot is not None:
        draw_map_fit(plot, done)
    document = document_of(done)
    if json:
        print(dumps(document.as_json(), indent=2))
    else:
        print_map_fit(document, results())
    say(messages, f"{output}: written" + ("" if plot is None else f"; {plot}: figure"))


def discover(
    out: Annotated[Path, Option("Folder for findings, amended model and report.", "DIR")],
    recordings: Recordings = (),
    from_evidence: Annotated[
        Path | None,
        Option("Instead of recordings: folder of events that `run` kept, [evidence] in the bench file.", "DIR"),
    ] = None,
    model: Annotated[
        Path | None,
        Option("Injector file (default: the bench file's, that of the evidence, else the nominal injector)."),
    ] = None,
    healthy: Annotated[
        tuple[Path, ...], Option("Recording of a healthy injector to judge the model by; repeatable.", "RECORDING")
    ] = (),
    choose: Annotated[
        str,
        Option(
            "Effect for the amended model, where several explain the recordings equally well; ID+ID for two.", "ID"
        ),
    ] = "",
    accept_term: Annotated[
        int | None, Option("Number of the proposed law that the amended model is to have.", "N", 0)
    ] = None,
    force: Force = False,
    bench: Decoder = None,
    from_channel: FromChannel = (),
    injector: Injector = None,
    json: Json = False,
) -> None:
    """Find the physical effect the model is missing, its size and how sure that is; write the amended model."""
    from observer_rt.desk.evaluation.healthy_events import learn_laws, observer_remainder
    from observer_rt.desk.identification_inputs import task_of_evidence, task_of_recordings
    from observer_rt.identification.discovery import amend, folder
    from observer_rt.identification.discovery import discover as discovery
    from observer_rt.identification.discovery.findings import FINDINGS
    from observer_rt.identification.discovery.report.text import as_text
    from observer_rt.identification.likelihood.reading import coverage

    require("jinja2", "matplotlib")
    begin = time.monotonic()
    if (from_evidence is None) == (not recordings):
        problem = "is missing" if from_evidence is None else "and --from-evidence are two sources"
        remedy = "give recordings, or the folder of evidence that the daemon keeps by --from-evidence"
        raise UserError("RECORDING", problem, remedy)
    decoder = decoder_of(bench, injector, model)
    chosen = effects_named("--choose", choose)
    if from_evidence is not None:
        model, task = task_of_evidence(from_evidence, model, decoder, messages)
    else:
        model, task = task_of_recordings(recordings, healthy, model, decoder, from_channel, messages)
    folder.check_answer_folder(out, model, force)
    amendable = InjectorFile.read(model)
    task = replace(task, chosen=chosen, accepted=accept_term or 0, observed=observer_remainder, learned=learn_laws)
    discovery.refuse_incomparable(task, str(model))
    make_folder("--out", out)
    for measurement in (*task.measured, *task.healthy):
        say(messages, coverage(measurement))
    with progress_bar(messages, "looking for what is missing", 1.0) as progress:
        try:
            findings = discovery.answer(task, progress)
        except KeyboardInterrupt:
            raise InterruptionError("interrupted; nothing was written") from None
    findings = replace(findings, seconds=time.monotonic() - begin)
    document = folder.write_findings(out, task, findings, amendable)
    if findings.not_accepted:
        say(messages, f"warning: {findings.not_accepted}")
    if json:
        print(document)
    else:
        say(results(), as_text(findings))
        more = [] if findings.amended_model is None else [amend.AMENDED]
        say(messages, f"{out}: {', '.join([folder.REPORT, FINDINGS, *more])}")


def effects(
    ids: Annotated[tuple[str, ...], Argument("Effects to describe in detail (default: all).", "ID")] = (),
    json: Json = False,
) -> None:
    """List the effects a model can have: unit, bounds, meaning, what each may be mistaken for."""
    from observer_rt.identification.discovery import effect_list
    from observer_rt.model.effects import VOCABULARY

    chosen = [effect_named("ID", name) for name in ids or VOCABULARY]
    if json:
        print(dumps(effect_list.as_json(chosen), indent=2))
    else:
        results().print(effect_list.as_table(chosen, in_detail=bool(ids)), highlight=False)


def take_over(
    amended: Annotated[Path | None, Argument("Amended injector file that `discover` wrote.", "AMENDED")] = None,
    bench: Annotated[Path | None, Option("Bench file that is to name it.")] = None,
    undo: Annotated[bool, Option("Instead: have the bench file name what it named before the last step.")] = False,
    accept_changes: Annotated[
        bool, Option("Take it over although it also changes parameters that the file in force states otherwise.")
    ] = False,
    injector: Injector = None,
) -> None:
    """Have a bench use an amended model, or undo that; the daemon that serves it reads it between two injections."""
    from observer_rt.desk import take_over as taking

    if bench is None:
        raise UserError("--bench", "is missing", "name the bench file that the daemon serves")
    if (amended is None) != undo:
        problem = "is missing" if amended is None else "and --undo exclude each other"
        raise UserError("AMENDED", problem, "give one of them")
    name = injector or ""
    done = taking.undo(bench, name) if amended is None else taking.take_over(bench, name, amended, accept_changes)
    before, words = done.step.before or "the nominal injector", done.step.as_text
    say(results(), f"{bench}: " + (f"{done.step.after} -> {before}" if undo else f"{before} -> {words}"))
    for change in done.changes:
        say(results(), f"  {change}")
    if done.answer is not None:
        unsaved = done.answer.get("unsaved")
        say(messages, "the daemon has it in force" + (f"\nwarning: {unsaved}" if unsaved else ""))
    else:
        say(messages, "no daemon is found by this bench file: one that serves it all the same reads it at SIGUSR1")
