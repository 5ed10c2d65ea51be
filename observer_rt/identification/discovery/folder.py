"""The folder of an answer: files it may replace, files it writes, and the fits that an interrupted search left."""

import hashlib
import json
import threading
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.injector_file import InjectorFile
from observer_rt.foundation import files
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.outputs import check_own_file, replacing, write_text
from observer_rt.identification.discovery.amend import (
    AMENDED,
    stable_cells,
    write_amended,
)
from observer_rt.identification.discovery.discover import DiscoveryTask
from observer_rt.identification.discovery.findings import (
    FINDINGS,
    Findings,
    ModelSource,
)
from observer_rt.identification.discovery.report.page import report
from observer_rt.identification.discovery.search.fits import Fit
from observer_rt.identification.planning.plan import write_schedule
from observer_rt.model.effect import SizedEffect
from observer_rt.model.parameters import InjectorParameters

REPORT, PLAN, FITS = "report.html", "plan.csv", "fits.jsonl"
ANSWER = (REPORT, FINDINGS, AMENDED, PLAN)
_KINDS = {
    REPORT: None,
    FINDINGS: files.FINDINGS,
    AMENDED: None,
    PLAN: files.PLAN,
    FITS: files.FITS,
}
FORMAT = 2
_PACKAGE = Path(__file__).parents[2]
_SOURCES = (".py", ".pyx", ".pxd", ".pxi")


def source_digest() -> str:
    """SHA-256 (hexadecimal) of the package's source: two states of it never have the same."""
    digest = hashlib.sha256()
    for path in sorted(each for each in _PACKAGE.rglob("*.p*") if each.suffix in _SOURCES):
        digest.update(path.relative_to(_PACKAGE).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def problem_key(
    parameters: InjectorParameters, recording_hashes: Sequence[str], stated: Sequence[SizedEffect] = ()
) -> str:
    """Hashes the problem that fits belong to: model, recordings (SHA-256 of each) and this program.

    stated: delays and lags of the recordings' channels.
    """
    why = {"__all__": {"origin", "evidence", "date"}}
    model = parameters.model_dump(mode="json", exclude={"format": True, "effects": why, "terms": why})
    channels = [(each.effect.id, *each.values) for each in stated]
    content = json.dumps([source_digest(), model, list(recording_hashes), channels], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()


class FitStore(dict[tuple[str, ...], Fit]):
    """JSON lines: what the fits belong to, then a fit a line. A `FitMemory`, used by several threads."""

    def __init__(self, path: Path, key: str) -> None:
        """Take over the fits of this key; a file of another key, or none, is begun anew.

        Raises OSError when the file cannot be read or written.
        """
        self._lock = threading.Lock()
        super().__init__(_read(path, key))
        self.taken_over = len(self)
        """Fits there were already."""
        header = json.dumps({"format": FORMAT, "key": key}) + "\n"
        with replacing(path) as part:
            part.write_text(header + "".join(_line(ids, *fit) for ids, fit in self.items()), "ascii")
        self._file = path.open("a", encoding="ascii")

    def __enter__(self) -> "FitStore":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def __setitem__(self, ids: tuple[str, ...], fit: Fit) -> None:
        """Keep a fit, at once on disk."""
        with self._lock:
            super().__setitem__(ids, fit)
            self._file.write(_line(ids, *fit))
            self._file.flush()


def _line(ids: tuple[str, ...], theta: NDArray[np.float64], statistic: float, spread: float) -> str:
    return json.dumps({"ids": ids, "theta": theta.tolist(), "statistic": statistic, "spread": spread}) + "\n"


def _read(path: Path, key: str) -> dict[tuple[str, ...], Fit]:
    """Fits of a file with this key; a line cut off while it was written ends it."""
    if not path.exists():
        return {}
    fits = {}
    header, *lines = path.read_text(encoding="ascii", errors="replace").splitlines() or [""]
    try:
        if json.loads(header) != {"format": FORMAT, "key": key}:
            return {}
        for line in lines:
            content = json.loads(line)
            statistic, spread = (float(content[name]) for name in ("statistic", "spread"))
            fits[tuple(content["ids"])] = np.array(content["theta"], float), statistic, spread
    except (ValueError, KeyError, TypeError):
        pass
    return fits


def check_answer_folder(folder: Path, model: Path | None, force: bool) -> None:
    """Check the folder of an answer about a model's file. force: an earlier one, known by its findings, may be there.

    Raises `UserError` where that model, an answer or a file of another kind would be replaced.
    """
    if folder.exists() and not folder.is_dir():
        raise UserError(f"--out {folder}", "is a file", "name a folder")
    if model is not None and (folder / AMENDED).resolve() == model.resolve():
        raise UserError(
            f"--out {folder}",
            f"holds the model to be amended as {AMENDED}",
            "name another folder, or copy the model",
        )
    for name, kind in _KINDS.items():
        if (folder / name).exists():
            check_own_file("--out", folder / name, kind)
    existing = [name for name in ANSWER if (folder / name).exists()]
    if existing and not (force and FINDINGS in existing):
        more = ", or add --force to replace what is there" if FINDINGS in existing else ""
        raise UserError(
            f"--out {folder}", f"holds {', '.join(existing)} already", f"name another folder{more}"
        )


def fits_in(folder: Path, task: DiscoveryTask, stated: Sequence[SizedEffect]) -> FitStore:
    """Store of a search's fits, with those of an interrupted one."""
    parts = [
        f"{sha256} {one.recording.samples}"  # of a long one the command decides how much is stored
        for sha256, one in zip(task.hashes.values(), task.measured, strict=True)
    ]
    parts += [  # what is taken out of the likelihood comes of these
        hashlib.sha256(one.recording.line_pressure.tobytes()).hexdigest() for one in task.healthy
    ]
    with file_errors(folder):
        return FitStore(folder / FITS, problem_key(task.parameters, parts, stated))


def write_findings(folder: Path, task: DiscoveryTask, findings: Findings, injector: InjectorFile) -> str:
    """Everything into the folder, and back what findings.json says.

    What an earlier run left there and this one does not make is removed.
    """
    in_force = (
        *(effect.id for effect in task.parameters.effects),
        *(f"{term.equation}: {term.law}" for term in task.parameters.terms),
    )
    model = ModelSource(injector.name, injector.sha256, in_force)
    written = replace(findings, model=model, made=datetime.now(), folder=str(folder))
    text = json.dumps(written.as_json(), indent=2)
    with file_errors(folder):
        write_text(folder / FINDINGS, text + "\n")
        write_text(folder / REPORT, report(written))
        (folder / PLAN).unlink(missing_ok=True)
        if written.plan is not None:
            write_schedule(folder / PLAN, written.plan)
        if written.amended_model is not None:
            cells = stable_cells(task.parameters, written.in_force, task.measured)
            write_amended(
                folder / AMENDED, injector, written.in_force, cells, written.terms, written.remainder
            )
        else:
            (folder / AMENDED).unlink(missing_ok=True)
    return text
