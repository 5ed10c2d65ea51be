"""Steps of a project, each after the fit: evaluate, discover, report. A step whose files are unchanged is skipped."""

import base64
import json
from datetime import datetime
from pathlib import Path
from typing import Any

import pandas as pd
from markupsafe import Markup

from observer_rt import __version__
from observer_rt.desk.library.injector import Injector
from observer_rt.desk.project.project import Project, Say
from observer_rt.foundation.figures import save_figure
from observer_rt.foundation.files import file_errors, templates_of
from observer_rt.foundation.outputs import write_text

FIT, FIT_FIGURE = "fit.json", "fit.png"
INJECTIONS, BUDGET, EVALUATION_FIGURE = "injections.csv", "budget.csv", "evaluation.png"
DISCOVERY, ANSWER, REPORT = "discovery", "discovery.txt", "report.html"
MOST_ROWS = 40
_PAGES = templates_of(__package__)
FITTED = "fitted.toml"
_DPI = 110


def write_page(project: Project) -> Path:
    """Write the page with the results of all steps; returns its path."""
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
            made=datetime.now(),
            version=__version__,
        )
        write_text(page, text)
    return page


def _rows(injections: pd.DataFrame, budget: pd.DataFrame) -> list[dict[str, Any]]:
    """Injections with their error budgets: all, or every n-th so that at most `MOST_ROWS` are left."""
    table = injections.merge(budget, how="left", on=["recording", "number"])
    if len(table) > MOST_ROWS:
        table = table.iloc[:: -(-len(table) // MOST_ROWS)]
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def _json(path: Path) -> Any:
    """Content of a JSON file, or None if there is no such file."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def _picture(path: Path) -> Markup | None:
    if not path.exists():
        return None
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    return Markup(f'<img alt="" src="data:image/png;base64,{data}">')


def fit(project: Project, say: Say) -> Path:
    """Fit the model to the healthy recordings; returns the injector file to go on with.

    That is the stated model if there are no healthy recordings. say: receives a line for every step done.
    """
    healthy, fitted = project.healthy, project.results / FITTED

    def work() -> str:
        injector = Injector.load(project.model, project.bench).fit(list(healthy), masses=project.masses)
        result = injector.calibration
        assert result is not None  # an injector that was fitted has it
        injector.save(fitted, force=True)
        write_text(project.results / FIT, json.dumps(result.document.as_json(), indent=2))
        save_figure(result.plot(), project.results / FIT_FIGURE, _DPI)
        return result.verdict

    if not healthy:
        say(f"fit: no healthy recordings; {project.model} is used as it is")
        return project.model
    return project.once("fit", [project.model, project.bench, project.masses, *healthy], fitted, work, say)


def evaluate(project: Project, model: Path, say: Say) -> Path:
    """Evaluate the recordings with the fitted model; returns the path of the table of injections."""
    recordings, table = project.recordings, project.results / INJECTIONS

    def work() -> str:
        result = Injector.load(model, project.bench).evaluate(list(recordings))
        write_text(table, result.injections.to_csv(index=False))
        write_text(project.results / BUDGET, result.budget.to_csv(index=False))
        save_figure(result.plot(), project.results / EVALUATION_FIGURE, _DPI)
        return f"{len(result.injections)} injections, {int(result.injections.valid.sum())} valid"

    return project.once("evaluate", [model, project.bench, *recordings], table, work, say)


def discover(project: Project, model: Path, say: Say) -> Path:
    """Search the recordings for the effect that the fitted model lacks; returns the path of the report."""
    recordings, page = project.recordings, project.results / DISCOVERY / REPORT

    def work() -> str:
        discovery = Injector.load(model, project.bench).discover(list(recordings))
        discovery.report(project.results / DISCOVERY, force=True)
        write_text(project.results / ANSWER, f"{discovery!r}\n")
        return repr(discovery).splitlines()[0]

    return project.once("discover", [model, project.bench, *recordings], page, work, say)


def report(project: Project, model: Path, say: Say) -> Path:
    """Evaluate, search, and write the page; returns its path."""
    evaluate(project, model, say)
    discover(project, model, say)
    page = write_page(project)
    say(f"report: {page}")
    return page


WITH_MODEL = {"evaluate": evaluate, "discover": discover, "report": report}


def do(step: str, project: Project, say: Say) -> Path:
    """Do the fit, then the step with this name; returns what it wrote."""
    model = fit(project, say)
    return model if step == "fit" else WITH_MODEL[step](project, model, say)
