"""`observer-rt project`: an engineer's week in one folder."""

from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated

from observer_rt.desk.cli.options import Standing, Writes, argument, file_option, messages
from observer_rt.foundation.console import results, say
from observer_rt.foundation.errors import UserError


class ProjectStep(StrEnum):
    """What to do."""

    NEW = "new"
    FIT = "fit"
    EVALUATE = "evaluate"
    DISCOVER = "discover"
    REPORT = "report"


def project(
    step: Annotated[
        ProjectStep,
        argument("new, or a step; each does first what it rests on.", "new|fit|evaluate|discover|report"),
    ],
    folder: Annotated[
        Path,
        argument("Folder of the project.", "DIR"),
        Writes(
            "`new`: `project.toml`; else `results`; markers: `project.toml`, `results/done.json`",
            Standing.MARKED,
            ("injector.toml", "results/fit.json"),
        ),
    ],
    model: Annotated[
        Path | None,
        file_option("--model", "With new: injector file to begin with (default: the nominal injector)."),
    ] = None,
) -> None:
    """Keep the work on an injector in a folder: fit, evaluation, discovery, report; redone where a file changed."""
    from observer_rt.desk.project.project import PROJECT, Project
    from observer_rt.desk.project.steps import do

    if step is ProjectStep.NEW:
        made = Project.new(folder, model)
        say(
            results(),
            f"{made.folder / PROJECT}: put recordings into {folder}/healthy and {folder}/recordings",
        )
        return
    if model is not None:
        raise UserError("--model", "is for a new project", f"name it in {folder / PROJECT}")
    do(step, Project.read(folder), partial(say, messages))
