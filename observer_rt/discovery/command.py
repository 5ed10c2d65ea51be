"""`observer-rt discover`: recordings in; findings, amended model and report out."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import load_injector
from observer_rt.config.effects import effect_named
from observer_rt.config.injector_file import InjectorFile
from observer_rt.discovery.answer import AskObserver, Question, answer, refuse_incomparable
from observer_rt.discovery.folder import (
    AMENDED,
    ANSWER,
    DATA,
    FINDINGS,
    FITS,
    REPORT,
    fits_in,
    make_folder,
    write_answer,
)
from observer_rt.discovery.report.text import as_text
from observer_rt.evidence.coverage import coverage
from observer_rt.evidence.reading import hashes, read_measured
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.model.effect import SizedEffect
from observer_rt.recording.formats import open_recording
from observer_rt.recording.signals.stream import SignalStream
from observer_rt.terminal.compiling import show_compiling
from observer_rt.terminal.console import progress_bar, results, say


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
    ids = options.chosen.split("+") if options.chosen else ()
    chosen = tuple(effect_named("--choose", name.strip()).id for name in ids)
    _refuse_replacing(options)
    injector = InjectorFile.read(options.model)
    measured = read_measured([*paths, *options.healthy], read, console, stated=stated)
    question = Question(parameters, measured[: len(paths)], measured[len(paths) :], hashes(paths), chosen)
    refuse_incomparable(question, str(options.model))
    make_folder(options.out)
    for one in measured:
        say(console, coverage(one))
    show_compiling(console)
    store = fits_in(options.out, question, stated)
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
    document = write_answer(options.out, question, found, injector, options.healthy, options.data)
    if options.json:
        print(document)
    else:
        say(results(), as_text(found))
        more = [
            name for name, is_there in ((AMENDED, bool(found.in_force)), (DATA, options.data)) if is_there
        ]
        say(console, f"{options.out}: {', '.join([REPORT, FINDINGS, *more])}")


def _refuse_replacing(options: DiscoverOptions) -> None:
    """Refuse to replace an answer, or a model that somebody may be using, unless that is wanted."""
    folder = options.out
    there = [name for name in ANSWER if (folder / name).exists()]
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
