"""Steps of a project, each after the fit: evaluate, discover, report. A step whose files are unchanged is skipped."""

import base64
import json
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import pandas as pd
from markupsafe import Markup

from observer_rt import __version__
from observer_rt.desk.library.injector import Injector
from observer_rt.desk.project.project import Project
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.figures import save_figure
from observer_rt.foundation.files import file_errors, templates_of
from observer_rt.foundation.outputs import write_text

FIT, FIT_FIGURE = "fit.json", "fit.png"
INJECTIONS, BUDGET, EVALUATION_FIGURE = "injections.csv", "budget.csv", "evaluation.png"
DISCOVERY, ANSWER, REPORT = "discovery", "discovery.txt", "report.html"
MOST_ROWS = 40
_PAGES = templates_of(__package__)
FIT_STEP, FITTED = "fit", "fitted.toml"
_DPI = 110
Say = Callable[[str], None]


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
            files=[(path, project.hash_of(path)[:12]) for path in _files(project)],
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


def _files(project: Project) -> list[Path]:
    named = [project.model, project.bench, project.masses, *project.healthy, *project.recordings]
    return [path for path in named if path is not None]


def fit(project: Project, say: Say) -> Path:
    """Fit the model to the healthy recordings; returns the injector file to go on with.

    That is the stated model if there are no healthy recordings. say: receives a line for every step done.
    """
    healthy = project.healthy
    if not healthy:
        say(f"fit: no healthy recordings; {project.model} is used as it is")
        return project.model
    fitted = project.results / FITTED
    state = project.state_of([project.model, project.bench, project.masses, *healthy])
    if project.is_done(FIT_STEP, state, fitted):
        say(f"fit: {fitted} is up to date")
        return fitted
    injector = Injector.load(project.model, project.bench).fit(list(healthy), masses=project.masses)
    result = injector.calibration
    assert result is not None  # an injector that was fitted has it
    injector.save(fitted, force=True)
    write_text(project.results / FIT, json.dumps(result.document.as_json(), indent=2))
    save_figure(result.plot(), project.results / FIT_FIGURE, _DPI)
    project.set_done(FIT_STEP, state)
    say(f"fit: {fitted}: {result.verdict}")
    return fitted


def evaluate(project: Project, model: Path, say: Say) -> Path:
    """Evaluate the recordings with the fitted model, in two passes; returns the path of the table of injections."""
    recordings = project.recordings
    table = project.results / INJECTIONS
    state = project.state_of([model, project.bench, *recordings])
    if project.is_done("evaluate", state, table):
        say(f"evaluate: {table} is up to date")
        return table
    result = Injector.load(model, project.bench).evaluate(list(recordings), twice=True)
    write_text(table, result.injections.to_csv(index=False))
    write_text(project.results / BUDGET, result.budget.to_csv(index=False))
    save_figure(result.plot(), project.results / EVALUATION_FIGURE, _DPI)
    project.set_done("evaluate", state)
    count = len(result.injections)
    say(f"evaluate: {table}: {count} injections, {int(result.injections.valid.sum())} valid")
    return table


def discover(project: Project, model: Path, say: Say) -> Path:
    """Search the recordings for the effect that the fitted model lacks; returns the path of the report."""
    recordings = project.recordings
    page = project.results / DISCOVERY / REPORT
    state = project.state_of([model, project.bench, *recordings])
    if project.is_done("discover", state, page):
        say(f"discover: {page} is up to date")
        return page
    discovery = Injector.load(model, project.bench).discover(list(recordings))
    discovery.report(project.results / DISCOVERY, force=True)
    write_text(project.results / ANSWER, f"{discovery!r}\n")
    project.set_done("discover", state)
    say(f"discover: {page}: {repr(discovery).splitlines()[0]}")
    return page


def report(project: Project, model: Path, say: Say) -> Path:
    """Evaluate, search, and write the page; returns its path."""
    evaluate(project, model, say)
    discover(project, model, say)
    page = write_page(project)
    say(f"report: {page}")
    return page


WITH_MODEL = {"evaluate": evaluate, "discover": discover, "report": report}


def do(step: str, project: Project, say: Say) -> Path:
    """Do the fit, then the step with this name; returns what it wrote. Raises `UserError` for an unknown name."""
    if step != FIT_STEP and step not in WITH_MODEL:
        raise UserError(step, "is not a step", f"give one of {', '.join((FIT_STEP, *WITH_MODEL))}")
    model = fit(project, say)
    return model if step == FIT_STEP else WITH_MODEL[step](project, model, say)
