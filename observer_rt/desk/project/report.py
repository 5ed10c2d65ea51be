"""The page of a project: fit, masses with what makes them uncertain, what is missing, and the files it rests on."""

import base64
import json
from datetime import datetime
from pathlib import Path
from typing import Any

import pandas as pd
from markupsafe import Markup

from observer_rt import __version__
from observer_rt.desk.project.project import Project
from observer_rt.foundation.files import file_errors, templates_of
from observer_rt.foundation.outputs import write_text

FIT, FIT_FIGURE = "fit.json", "fit.png"
INJECTIONS, BUDGET, EVALUATION_FIGURE = "injections.csv", "budget.csv", "evaluation.png"
DISCOVERY, ANSWER, REPORT = "discovery", "discovery.txt", "report.html"
MOST_ROWS = 40
_PAGES = templates_of(__package__)


def write_page(project: Project) -> Path:
    """Write the page of what was made; its path."""
    results, page = project.results, project.results / REPORT
    with file_errors(results):
        document = _json(results / FIT)
        injections = pd.read_csv(results / INJECTIONS)
        budget = pd.read_csv(results / BUDGET)
        answer = (results / ANSWER).read_text(encoding="utf-8")
        text = _PAGES.get_template("report.html.j2").render(
            name=project.folder.resolve().name,
            fit=document,
            level_is_measured=document is not None and document["level"]["from"] != "file",
            fit_figure=_picture(results / FIT_FIGURE),
            evaluation_figure=_picture(results / EVALUATION_FIGURE),
            rows=_rows(injections, budget),
            most=MOST_ROWS,
            count=len(injections),
            valid=int(injections.valid.sum()),
            answer=answer,
            page=f"{DISCOVERY}/{REPORT}",
            has_amended=(results / DISCOVERY / "amended.toml").exists(),
            files=[(path, project.hash_of(path)[:12]) for path in _files(project)],
            made=datetime.now(),
            version=__version__,
        )
        write_text(page, text)
    return page


def _rows(injections: pd.DataFrame, budget: pd.DataFrame) -> list[dict[str, Any]]:
    """Injections with their budgets, some of many, spread over all."""
    table = injections.merge(budget, how="left", on=["recording", "number"])
    if len(table) > MOST_ROWS:
        table = table.iloc[:: -(-len(table) // MOST_ROWS)]
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def _json(path: Path) -> Any:
    """A document; None where there is none."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def _picture(path: Path) -> Markup | None:
    if not path.exists():
        return None
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    return Markup(f'<img alt="" src="data:image/png;base64,{data}">')


def _files(project: Project) -> list[Path]:
    named = [project.model, project.bench, project.masses, *project.healthy, *project.recordings]
    return [path for path in named if path is not None]
