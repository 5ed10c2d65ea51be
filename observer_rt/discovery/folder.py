"""The folder of an answer: report, findings, amended model, and the fits of a search that was interrupted."""

import hashlib
import json
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from observer_rt.config.injector_file import InjectorFile
from observer_rt.discovery.amend import stable_cells, write_amended
from observer_rt.discovery.answer import Question
from observer_rt.discovery.findings import Findings, Sources
from observer_rt.discovery.report.data import remove_data, write_data
from observer_rt.discovery.report.document import as_json
from observer_rt.discovery.report.report import report
from observer_rt.discovery.search.candidates import FitStore, problem_key
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.model.effect import SizedEffect
from observer_rt.terminal.console import check_folder

FINDINGS, AMENDED, REPORT, FITS = "findings.json", "amended.toml", "report.html", "fits.jsonl"
DATA = "data"
ANSWER = (REPORT, FINDINGS, AMENDED, DATA)


def refuse_replacing(folder: Path, model: Path, force: bool) -> None:
    """Raise `UserError` where an answer, or a model that somebody may be using, would be replaced unless wanted."""
    there = [name for name in ANSWER if (folder / name).exists()]
    if (folder / AMENDED).resolve() == model.resolve():
        raise UserError(
            f"--out {folder}",
            f"holds the model to be amended as {AMENDED}",
            "name another folder, or copy the model",
        )
    if there and not force:
        raise UserError(
            f"--out {folder}",
            f"holds {', '.join(there)} already",
            "name another folder, or add --force to replace what is there",
        )


def make_folder(folder: Path) -> None:
    """The folder, if it is not there. Raises `UserError` where it cannot be made or written."""
    if folder.exists() and not folder.is_dir():
        raise UserError(f"--out {folder}", "is a file", "name a folder")
    with file_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    check_folder("--out", folder)


def fits_in(folder: Path, question: Question, stated: Sequence[SizedEffect]) -> FitStore:
    """Where the search for an answer keeps its fits, and finds those of an interrupted one."""
    parts = [
        f"{sha256} {one.recording.samples}"  # of a long one it depends on the command how much is kept
        for sha256, one in zip(question.hashes.values(), question.measured, strict=True)
    ]
    parts += [  # what is taken out of the evidence comes of these
        hashlib.sha256(one.recording.line_pressure.tobytes()).hexdigest() for one in question.healthy
    ]
    with file_errors(folder):
        return FitStore(folder / FITS, problem_key(question.parameters, parts, stated))


def write_answer(
    folder: Path,
    question: Question,
    found: Findings,
    injector: InjectorFile,
    healthy: Sequence[Path],
    data: bool = False,
) -> str:
    """Everything into the folder, and back what findings.json says. data: figures and numbers as files, too.

    What an earlier run left there and this one does not make is removed.
    """
    sources = Sources(
        model=injector.name,
        model_hash=injector.sha256,
        in_force=tuple(effect.id for effect in question.parameters.effects),
        recordings=question.hashes,
        healthy=tuple(path.name for path in healthy),
        made=datetime.now(),
    )
    document = json.dumps(as_json(found, sources), indent=2)
    with file_errors(folder):
        (folder / FINDINGS).write_text(document + "\n", encoding="utf-8")
        (folder / REPORT).write_text(report(found, sources), encoding="utf-8")
        remove_data(folder / DATA)
        if data:
            write_data(folder / DATA, found)
        if found.amended_model is not None:
            cells = stable_cells(question.parameters, found.in_force, question.measured)
            write_amended(folder / AMENDED, injector, found.in_force, cells, found.terms)
        else:
            (folder / AMENDED).unlink(missing_ok=True)
    return document
