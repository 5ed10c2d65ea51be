"""Commands that find out what a model should be: `fit`, `discover`, `compare` and `effects`."""

import json
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

from observer_rt.config.bench import load_injector
from observer_rt.config.effects import effect_named, effects_named
from observer_rt.config.injector_file import InjectorFile
from observer_rt.desk.cli import options
from observer_rt.desk.cli.options import (
    Standing,
    Writes,
    argument,
    decoder_of,
    file_option,
    messages,
    option,
)
from observer_rt.foundation.console import (
    FIGURE_SUFFIXES,
    progress_bar,
    results,
    say,
)
from observer_rt.foundation.errors import InterruptionError, UserError
from observer_rt.foundation.outputs import check_output, make_folder


def fit(
    recordings: options.RecordingsArgument,
    model: Annotated[
        Path,
        file_option(
            "--model", "Injector file to start from: geometry right, the rest within a factor of two."
        ),
    ],
    output: Annotated[
        Path, file_option("--output", "Fitted injector file to write."), Writes("injector file")
    ],
    mass: Annotated[
        Path | None,
        file_option(
            "--mass",
            "Measured masses (CSV: recording,mass_mg[,injection][,sigma_mg]), which fix the absolute level.",
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        file_option("--plot", "Figure (png, svg, pdf): line pressure and residuals by phase."),
        Writes("figure"),
    ] = None,
    force: options.ForceOption = False,
    bench: options.DecoderOption = None,
    from_channel: options.FromChannelOption = None,
    injector: options.InjectorOption = None,
    lenient: options.LenientOption = False,
    yes: options.YesOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Calibrate the model, its structure included, to recordings of the healthy injector."""
    from observer_rt.config.channels import effects_on_one_raster
    from observer_rt.desk.evaluation.guessing import as_confirmed
    from observer_rt.desk.evaluation.logged import open_source, without_truths
    from observer_rt.desk.fitted_model import fitted_model
    from observer_rt.identification.fit.cross_validation import read_masses, refuse_clipped, warnings
    from observer_rt.identification.fit.document import document_of
    from observer_rt.identification.fit.report import print_fit
    from observer_rt.identification.likelihood.excerpts import MOST_SAMPLES
    from observer_rt.identification.likelihood.reading import (
        coverage,
        hashes,
        read_measured,
        refuse_rates_missing,
        without_copies,
    )

    decoder = as_confirmed(decoder_of(bench, injector, lenient, model), recordings, yes, messages)
    start, source = load_injector(model), InjectorFile.read(model)
    if output.resolve() == model.resolve():
        raise UserError(
            f"--output {output}", "is the model that is fitted", "name another file, to compare the two"
        )
    for name, path, suffixes in (("--output", output, (".toml",)), ("--plot", plot, FIGURE_SUFFIXES)):
        if path is not None:
            check_output(name, path, force, suffixes=suffixes)
    paths = without_copies(without_truths(recordings, messages), messages)
    read = partial(open_source, bench=decoder, from_channels=from_channel or (), console=messages)
    most = MOST_SAMPLES if mass is None else sys.maxsize  # whole: masses go by the injection's number
    stated = () if decoder is None else effects_on_one_raster(decoder.injector)
    found = read_measured(paths, read, messages, most, stated)
    refuse_rates_missing([one.recording for one in found])
    refuse_clipped(found)
    weighed = {} if mass is None else read_masses(mass, found)
    warned = warnings(found)
    for line in (*map(coverage, found), *(f"warning: {one}" for one in warned)):
        say(messages, line)
    with progress_bar(messages, "fitting", 1.0) as progress:
        try:
            fitted = fitted_model(start, found, weighed, hashes(paths), progress)
        except KeyboardInterrupt:
            raise InterruptionError("interrupted; nothing was written") from None
    fitted.write(output, source)
    done = fitted.done
    if plot is not None:
        from observer_rt.identification.fit.report import draw_fit

        draw_fit(plot, done)
    if as_json:
        print(json.dumps(document_of(done, fitted.baseline, warned).as_json(), indent=2))
    else:
        print_fit(done, results())
    say(messages, f"{output}: written" + ("" if plot is None else f"; {plot}: figure"))


def discover(
    out: Annotated[
        Path,
        option("--out", "Folder for findings, amended model and report.", "DIR"),
        Writes(
            "answer to a search that goes on where `fits.jsonl` ends",
            Standing.ANSWER,
            ("findings.json", "report.html", "amended.toml", "plan.csv", "data", "fits.jsonl"),
        ),
    ],
    recordings: options.OptionalRecordingsArgument = None,
    from_evidence: Annotated[
        Path | None,
        option(
            "--from-evidence",
            "Instead of recordings: folder of events that `run` kept, [evidence] in the bench file.",
            "DIR",
            show_default=False,
        ),
    ] = None,
    model: Annotated[
        Path | None,
        file_option(
            "--model",
            "Injector file (default: the bench file's, that of the evidence, else the nominal injector).",
            show_default=False,
        ),
    ] = None,
    healthy: Annotated[
        list[Path] | None,
        option(
            "--healthy", "Recording of a healthy injector to judge the model by; repeatable.", "RECORDING"
        ),
    ] = None,
    choose: Annotated[
        str,
        option(
            "--choose",
            "Effect for the amended model, where several explain the recordings equally well; ID+ID for two.",
            "ID",
            show_default=False,
        ),
    ] = "",
    accept_term: Annotated[
        int,
        option(
            "--accept-term",
            "Number of the proposal, in an `unknown` answer, that the amended model is to have.",
            "N",
            show_default=False,
            min=0,
        ),
    ] = 0,
    instead: Annotated[
        str,
        option(
            "--instead",
            "With --accept-term: the law of this equation, which line pressure cannot tell from the proposal's.",
            "EQUATION",
            show_default=False,
        ),
    ] = "",
    in_part: Annotated[
        bool,
        option(
            "--in-part",
            "With --accept-term: also a proposal that closes two thirds of the gap; the rest widens all intervals.",
        ),
    ] = False,
    force: options.ForceOption = False,
    data: Annotated[
        bool, option("--data", "Also write the figures (SVG) and the numbers behind them (CSV).")
    ] = False,
    plan: Annotated[
        bool,
        option(
            "--plan",
            "Also plan what to measure next: operating points that decide between what is left, as a schedule (CSV).",
        ),
    ] = False,
    bench: options.DecoderOption = None,
    from_channel: options.FromChannelOption = None,
    injector: options.InjectorOption = None,
    lenient: options.LenientOption = False,
    yes: options.YesOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Find the physical effect the model is missing, its size and how sure that is; write the amended model."""
    from observer_rt.desk.asked import asked_of_evidence, asked_of_recordings
    from observer_rt.desk.evaluation.guessing import as_confirmed
    from observer_rt.desk.evaluation.healthy_events import observer_remainder
    from observer_rt.desk.simulation.simulate import two_injections
    from observer_rt.identification.discovery.discover import (
        AMENDED,
        DATA,
        FITS,
        PLAN,
        REPORT,
        DiscoveryTask,
        answer,
        check_answer_folder,
        fits_in,
        planned,
        refuse_incomparable,
        write_findings,
    )
    from observer_rt.identification.discovery.report.document import FINDINGS
    from observer_rt.identification.discovery.report.plan import print_plan
    from observer_rt.identification.discovery.report.text import as_text
    from observer_rt.identification.likelihood.reading import coverage

    for name, wanted in (("--in-part", in_part), ("--instead", instead)):
        if wanted and not accept_term:
            raise UserError(name, "says nothing of which proposal", "add --accept-term N")
    begin = time.monotonic()
    if (from_evidence is None) == (not recordings):
        raise UserError(
            "RECORDING",
            "is missing" if from_evidence is None else "and --from-evidence are two sources",
            "give recordings, or the folder of evidence that the daemon keeps by --from-evidence",
        )
    given = (*(recordings or ()), *(healthy or ()))
    decoder = as_confirmed(decoder_of(bench, injector, lenient, model), given, yes, messages)
    chosen = effects_named("--choose", choose)
    if from_evidence is not None:
        asked = asked_of_evidence(from_evidence, model, decoder, messages)
    else:
        asked = asked_of_recordings(
            recordings or (), healthy or (), model, decoder, from_channel or (), messages
        )
    check_answer_folder(out, asked.model, force)
    amendable = InjectorFile.read(asked.model)
    observed = observer_remainder if in_part else None
    task = DiscoveryTask(
        load_injector(asked.model),
        asked.measured,
        asked.healthy,
        asked.hashes,
        chosen,
        accept_term,
        instead,
        observed,
    )
    refuse_incomparable(task, str(asked.model))
    make_folder("--out", out)
    for one in (*asked.measured, *asked.healthy):
        say(messages, coverage(one))
    store = fits_in(out, task, asked.stated)
    if store.taken_over:
        say(messages, f"going on with {store.taken_over} candidates fitted before")
    with store, progress_bar(messages, "looking for what is missing", 1.0) as progress:
        try:
            found = answer(task, store, progress, AMENDED)
        except KeyboardInterrupt:
            raise InterruptionError(
                f"interrupted; {store.kept} fitted candidates are kept in {out / FITS}\n"
                "  remedy: give the same command again to go on"
            ) from None
    if plan:
        with progress_bar(messages, "planning what to measure next", 1.0) as progress:
            found = planned(found, task, two_injections, progress)
    found = replace(found, seconds=time.monotonic() - begin)
    document = write_findings(out, task, found, amendable, asked.references, data)
    if found.not_accepted:
        say(messages, f"warning: {found.not_accepted}")
    if as_json:
        print(document)
    else:
        say(results(), as_text(found))
        if plan:
            print_plan(found.plan, results())
        written = (
            (AMENDED, found.amended_model is not None),
            (PLAN, found.plan is not None),
            (DATA, data),
        )
        more = [name for name, is_there in written if is_there]
        say(messages, f"{out}: {', '.join([REPORT, FINDINGS, *more])}")


def compare(
    runs: Annotated[list[Path], argument("Folders that `discover --out` wrote.", "DIR")],
    as_json: options.JsonOption = False,
) -> None:
    """Compare runs of `discover`: verdicts, sizes, gaps, and what changed from the first to the last."""
    from observer_rt.identification.discovery import runs as comparison

    if len(runs) < 2:
        raise UserError("DIR", "is one run", "name two folders or more")
    found = [comparison.DiscoveryRun.read(path) for path in runs]
    if as_json:
        print(json.dumps(comparison.as_json(found), indent=2))
        return
    console = results()
    console.print(comparison.run_table(found))
    for line in comparison.change_lines(found):
        say(console, line)


def effects(
    ids: Annotated[list[str] | None, argument("Effects to describe in detail (default: all).", "ID")] = None,
    as_json: options.JsonOption = False,
) -> None:
    """List the effects a model can have: unit, bounds, meaning, what each may be mistaken for."""
    from observer_rt.identification.discovery import vocabulary
    from observer_rt.model.effects import VOCABULARY

    chosen = [effect_named("ID", name) for name in ids or VOCABULARY]
    if as_json:
        print(json.dumps(vocabulary.as_json(chosen), indent=2))
    else:
        results().print(vocabulary.as_table(chosen, in_detail=bool(ids)), highlight=False)
