"""`observer-rt discover`: recordings in; findings, amended model and report out."""

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import load_injector
from observer_rt.config.effects import effect_named
from observer_rt.discovery.answer import AskObserver, Question, answer
from observer_rt.discovery.findings import Findings, Sources
from observer_rt.discovery.injector_text import InjectorText, write_amended
from observer_rt.discovery.report.data import remove_data, write_data
from observer_rt.discovery.report.document import as_json
from observer_rt.discovery.report.report import report
from observer_rt.discovery.report.text import as_text
from observer_rt.discovery.search.fit_store import FitStore, problem_key
from observer_rt.evidence.coverage import coverage
from observer_rt.evidence.plausible import refuse_rates_missing
from observer_rt.evidence.reading import hashes, read_measured
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.foundation.file_errors import file_errors
from observer_rt.foundation.file_hash import file_hash
from observer_rt.model.cells import refuse_unstable_cells
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import effective_model
from observer_rt.recording.formats import open_recording
from observer_rt.recording.signals.stream import SignalStream
from observer_rt.terminal.console import progress_bar, results, say, say_if_compiling
from observer_rt.terminal.destinations import check_folder

FINDINGS, AMENDED, REPORT, FITS = "findings.json", "amended.toml", "report.html", "fits.jsonl"
DATA = "data"


@dataclass(frozen=True)
class DiscoverOptions:
    """Options of the command. healthy: recordings the model is judged against; chosen: `id` or `id+id` of effects
    that are to lead where several explain the recordings; force: what stands in the folder may be replaced; data:
    the figures and the numbers behind the report are wanted as files, too.
    """

    model: Path
    out: Path
    healthy: tuple[Path, ...]
    json: bool
    chosen: str = ""
    force: bool = False
    data: bool = False


def discover_files(
    paths: Sequence[Path],
    options: DiscoverOptions,
    ask_observer: AskObserver,
    console: Console,
    read: Callable[[Path], SignalStream] = open_recording,
    stated: tuple[SizedEffect, ...] = (),
) -> None:
    """Find the missing effect in recordings; write everything into a folder, print the answer.

    read: looks through a file the user named, and refuses one that is none; stated: what the bench file says of the
    channels.

    Raises `UserError` for files that will not do, before the work begins; `RunError` when it fails or is interrupted.
    """
    begin = time.monotonic()
    parameters = load_injector(options.model)
    chosen = _chosen(options.chosen)
    _refuse_replacing(options)
    source = InjectorText(options.model)
    measured = read_measured([*paths, *options.healthy], read, console, stated=stated)
    refuse_rates_missing([one.recording for one in measured[: len(paths)]])
    coefficients = measured[0].coefficients_of(effective_model(parameters))
    refuse_unstable_cells(str(options.model), parameters, coefficients, measured[0].interval)
    question = Question(parameters, measured[: len(paths)], measured[len(paths) :], hashes(paths), chosen)
    _make_folder(options.out)
    for one in measured:
        say(console, coverage(one))
    say_if_compiling(console)
    with file_errors(options.out):
        store = FitStore(options.out / FITS, problem_key(parameters, list(question.hashes.values()), stated))
    if store.taken_over:
        say(console, f"going on with {store.taken_over} candidates fitted before")
    with store, progress_bar(console, "looking for what is missing", 1.0) as progress:
        try:
            found = answer(question, store, ask_observer, progress, AMENDED)
        except KeyboardInterrupt:
            raise RunError(
                f"interrupted; {store.kept} fitted candidates are kept in {options.out / FITS}\n"
                "  remedy: give the same command again to go on"
            ) from None
    found = replace(found, seconds=time.monotonic() - begin)
    document = _write(options, found, _sources(options, question), source)
    if options.json:
        print(document)
    else:
        say(results(), as_text(found))
        more = [
            name for name, is_there in ((AMENDED, bool(found.in_force)), (DATA, options.data)) if is_there
        ]
        say(console, f"{options.out}: {', '.join([REPORT, FINDINGS, *more])}")


def _chosen(text: str) -> tuple[str, ...]:
    """Ids of the effects chosen. Raises `UserError` for one that is none."""
    return tuple(effect_named("--choose", name.strip()).id for name in text.split("+")) if text else ()


def _refuse_replacing(options: DiscoverOptions) -> None:
    """Refuse to replace an answer, or a model that somebody may be using, unless that is wanted."""
    folder = options.out
    there = [name for name in (REPORT, FINDINGS, AMENDED, DATA) if (folder / name).exists()]
    if (folder / AMENDED).resolve() == options.model.resolve():
        raise UserError(
            f"--out {folder}",
            f"holds the model to be amended as {AMENDED}",
            "name another folder, or copy the model",
        )
    if there and not options.force:
        raise UserError(
            f"--out {folder}",
            f"holds {', '.join(there)} already",
            "name another folder, or add --force to replace what is there",
        )


def _make_folder(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise UserError(f"--out {folder}", "is a file", "name a folder")
    with file_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    check_folder("--out", folder)


def _sources(options: DiscoverOptions, question: Question) -> Sources:
    return Sources(
        model=options.model.name,
        model_hash=file_hash(options.model),
        in_force=tuple(effect.id for effect in question.parameters.effects),
        recordings=question.hashes,
        healthy=tuple(path.name for path in options.healthy),
        made=datetime.now(),
    )


def _write(options: DiscoverOptions, found: Findings, sources: Sources, injector: InjectorText) -> str:
    """Everything into the folder, and back what findings.json says.

    What an earlier run left there and this one does not make is removed.
    """
    folder = options.out
    document = json.dumps(as_json(found, sources), indent=2)
    with file_errors(folder):
        (folder / FINDINGS).write_text(document + "\n", encoding="utf-8")
        (folder / REPORT).write_text(report(found, sources), encoding="utf-8")
        remove_data(folder / DATA)
        if options.data:
            write_data(folder / DATA, found)
        if found.in_force:
            write_amended(folder / AMENDED, injector, found.in_force)
        else:
            (folder / AMENDED).unlink(missing_ok=True)
    return document
