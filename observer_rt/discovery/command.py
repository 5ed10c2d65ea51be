"""`observer-rt discover`: recordings in; findings, amended model and report out."""

import datetime
import json
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from observer_rt.config import load_injector
from observer_rt.destinations import check_folder
from observer_rt.discovery.add import InjectorText, evidence_of, in_force, write_amended
from observer_rt.discovery.data import Measurement, measurements
from observer_rt.discovery.find import disagreements
from observer_rt.discovery.findings import Findings, as_json
from observer_rt.discovery.fit_store import FitStore, file_hash, problem_key
from observer_rt.discovery.naming import Options, name_effects
from observer_rt.discovery.plausible import refuse_implausible, refuse_mixed
from observer_rt.discovery.result import Discovery
from observer_rt.discovery.show import gaps_of
from observer_rt.discovery.text import as_text
from observer_rt.errors import RunError, UserError
from observer_rt.model.effects import effective_model
from observer_rt.model.parameters import EffectInForce, InjectorParameters
from observer_rt.recording.files import file_errors, read_recording
from observer_rt.screen import progress_bar, results, say, say_if_compiling

FINDINGS, AMENDED, FITS = "findings.json", "amended.toml", "fits.jsonl"
_SEARCH = 0.9  # share of the work


@dataclass(frozen=True)
class DiscoverOptions:
    """Options of the command. healthy: recordings the model is judged by."""

    model: Path
    out: Path
    json: bool


def discover_files(paths: Sequence[Path], options: DiscoverOptions, console: Console) -> None:
    """Find the missing effect in recordings; write everything into a folder, print the answer.

    Raises `UserError` for files that will not do, before the work begins; `RunError` when it fails or is interrupted.
    """
    begin = time.monotonic()
    parameters = load_injector(options.model)
    source = InjectorText(options.model)
    measured = _measured(paths)
    _make_folder(options.out)
    hashes = {path.name: file_hash(path) for path in paths}
    store = FitStore(options.out / FITS, problem_key(parameters, list(hashes.values())))
    say_if_compiling(console)
    if store.taken_over:
        say(console, f"going on with {store.taken_over} candidates fitted before")
    nominal = effective_model(parameters)
    with store, progress_bar(console, "looking for what is missing", 1.0) as progress:
        try:
            found = name_effects(nominal, measured, _search_options(store, progress))
            gaps = gaps_of(found, measured, nominal)
        except KeyboardInterrupt:
            raise RunError(
                f"interrupted; {store.kept} fitted candidates are kept in {options.out / FITS}\n"
                "  remedy: give the same command again to go on"
            ) from None
    names = tuple(path.name for path in paths)
    findings = Findings(
        discovery=found,
        where=disagreements(found),
        gaps=gaps,
        amended_model=AMENDED if found.effects else None,
        recordings=names,
        fitted_on=tuple(names[i] for i in gaps.fitted_on),
        held_out=tuple(names[i] for i in gaps.held_out),
        seconds=time.monotonic() - begin,
    )
    _write(options.out, findings, source, _amended(parameters, found, hashes))
    if options.json:
        print(json.dumps(as_json(findings), indent=2))
    else:
        say(results(), as_text(findings))
        say(console, f"findings and report in {options.out}")


def _search_options(store: FitStore, progress: Callable[[float], None]) -> Options:
    workers = len(os.sched_getaffinity(0))
    return Options(workers, memory=store, progress=lambda share: progress(_SEARCH * share))


def _measured(paths: Sequence[Path]) -> tuple[Measurement, ...]:
    """Recordings, read and looked through; refused before anything is written."""
    for number, path in enumerate(paths):
        if path.resolve() in {other.resolve() for other in paths[:number]}:
            raise UserError(str(path), "is given twice", "give every recording once")
    recordings = [read_recording(path) for path in paths]
    refuse_mixed(recordings)
    measured = measurements(recordings)
    for one in measured:
        refuse_implausible(one)
    return measured


def _make_folder(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise UserError(f"--out {folder}", "is a file", "name a folder")
    with file_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    check_folder("--out", folder)


def _amended(
    parameters: InjectorParameters, found: Discovery, hashes: dict[str, str]
) -> tuple[EffectInForce, ...]:
    """The effects in force with those found, in the order of the file."""
    today = datetime.date.today()
    new = [in_force(effect, evidence_of(found, effect, hashes), today) for effect in found.effects]
    return (*parameters.effects, *new)


def _write(folder: Path, findings: Findings, source: InjectorText, effects: Sequence[EffectInForce]) -> None:
    """Everything into the folder; what an earlier run left there and this one does not make is removed."""
    with file_errors(folder):
        (folder / FINDINGS).write_text(json.dumps(as_json(findings), indent=2) + "\n", encoding="utf-8")
        if findings.amended_model is None:
            (folder / AMENDED).unlink(missing_ok=True)
        else:
            write_amended(folder / AMENDED, source, effects)
