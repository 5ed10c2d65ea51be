"""The folder of an answer: files it may replace, and files it writes."""

import json
from dataclasses import replace
from datetime import datetime
from pathlib import Path

from observer_rt.config.injector_file import InjectorFile
from observer_rt.foundation import outputs
from observer_rt.foundation.errors import UserError, file_errors, require
from observer_rt.foundation.files import write_text
from observer_rt.identification.discovery.amend import AMENDED, stable_cells, write_amended
from observer_rt.identification.discovery.discover import DiscoveryTask
from observer_rt.identification.discovery.findings import FINDINGS, Findings, ModelSource

REPORT = "report.html"
_KINDS = {REPORT: None, FINDINGS: outputs.FINDINGS, AMENDED: None}


def check_answer_folder(folder: Path, model: Path | None, force: bool) -> None:
    """Raises `UserError` where the model, an answer (unless `force`) or a file of another kind would be replaced."""
    if folder.exists() and not folder.is_dir():
        raise UserError(f"--out {folder}", "is a file", "name a folder")
    if model is not None and (folder / AMENDED).resolve() == model.resolve():
        raise UserError(
            f"--out {folder}", f"holds the model to be amended as {AMENDED}", "name another folder, or copy the model"
        )
    existing = [name for name in _KINDS if (folder / name).exists()]
    for name in existing:
        outputs.check_own_file("--out", folder / name, _KINDS[name])
    if existing and not (force and FINDINGS in existing):
        more = ", or add --force to replace what is there" if FINDINGS in existing else ""
        raise UserError(f"--out {folder}", f"holds {', '.join(existing)} already", f"name another folder{more}")


def write_findings(folder: Path, task: DiscoveryTask, findings: Findings, injector: InjectorFile) -> str:
    """Write findings.json, whose text is returned, report and amended model; an earlier one is removed."""
    require("jinja2", "matplotlib")
    from observer_rt.identification.discovery.report.page import report

    before = [effect.id for effect in task.parameters.effects]
    before += [f"{term.equation}: {term.law}" for term in task.parameters.terms]
    model = ModelSource(injector.name, injector.sha256, in_force=tuple(before))
    written = replace(findings, model=model, made=datetime.now(), folder=str(folder))
    text = json.dumps(written.as_json(), indent=2)
    with file_errors(folder):
        write_text(folder / FINDINGS, text + "\n")
        write_text(folder / REPORT, report(written))
        if written.amended_model is not None:
            cells = stable_cells(task.parameters, written.in_force, task.measured)
            write_amended(folder / AMENDED, injector, written.in_force, cells, written.terms, written.remainder)
        else:
            (folder / AMENDED).unlink(missing_ok=True)
    return text
