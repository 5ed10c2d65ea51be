"""Steps of a project: fit, evaluate, discover, report; fit comes before each, and nothing is done twice."""

import json
from collections.abc import Callable
from pathlib import Path

from observer_rt.desk.library.injector import Injector
from observer_rt.desk.project.project import Project
from observer_rt.desk.project.report import (
    ANSWER,
    BUDGET,
    DISCOVERY,
    EVALUATION_FIGURE,
    FIT,
    FIT_FIGURE,
    INJECTIONS,
    REPORT,
    write_page,
)
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.figures import save_figure
from observer_rt.foundation.outputs import write_text

FIT_STEP, FITTED = "fit", "fitted.toml"
_DPI = 110
Say = Callable[[str], None]


def fit(project: Project, say: Say) -> Path:
    """Fit the model to the healthy recordings; the fitted injector file, or the model as given where there is none.

    say: takes what was done, a line each.
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
    assert result is not None  # of what was fitted
    injector.save(fitted, force=True)
    write_text(project.results / FIT, json.dumps(result.document.as_json(), indent=2))
    save_figure(result.plot(), project.results / FIT_FIGURE, _DPI)
    project.set_done(FIT_STEP, state)
    say(f"fit: {fitted}: {result.verdict}")
    return fitted


def evaluate(project: Project, model: Path, say: Say) -> Path:
    """Evaluate the recordings with the fitted model, looked at twice; the table of injections."""
    recordings = project.recordings
    table = project.results / INJECTIONS
    state = project.state_of([model, project.bench, *recordings])
    if project.is_done("evaluate", state, table):
        say(f"evaluate: {table} is up to date")
        return table
    result = Injector.load(model, project.bench).evaluate(list(recordings))
    write_text(table, result.injections.to_csv(index=False))
    write_text(project.results / BUDGET, result.budget.to_csv(index=False))
    save_figure(result.plot(), project.results / EVALUATION_FIGURE, _DPI)
    project.set_done("evaluate", state)
    count = len(result.injections)
    say(f"evaluate: {table}: {count} injections, {int(result.injections.valid.sum())} valid")
    return table


def discover(project: Project, model: Path, say: Say) -> Path:
    """Search the recordings for what the fitted model is missing; the page of the answer."""
    recordings = project.recordings
    page = project.results / DISCOVERY / REPORT
    state = project.state_of([model, project.bench, *recordings])
    if project.is_done("discover", state, page):
        say(f"discover: {page} is up to date")
        return page
    found = Injector.load(model, project.bench).discover(list(recordings))
    found.report(project.results / DISCOVERY, force=True)
    write_text(project.results / ANSWER, f"{found!r}\n")
    project.set_done("discover", state)
    say(f"discover: {page}: {repr(found).splitlines()[0]}")
    return page


def report(project: Project, model: Path, say: Say) -> Path:
    """Evaluate and search with the fitted model, and write the page."""
    evaluate(project, model, say)
    discover(project, model, say)
    page = write_page(project)
    say(f"report: {page}")
    return page


WITH_MODEL = {"evaluate": evaluate, "discover": discover, "report": report}


def do(step: str, project: Project, say: Say) -> Path:
    """Do a step by its name, after the fit. Raises `UserError` for a name that is none."""
    if step != FIT_STEP and step not in WITH_MODEL:
        raise UserError(step, "is no step", f"give one of {', '.join((FIT_STEP, *WITH_MODEL))}")
    model = fit(project, say)
    return model if step == FIT_STEP else WITH_MODEL[step](project, model, say)
