"""`observer-rt project`: an engineer's week in one folder."""

from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated

from observer_rt.desk.cli.command import messages
from observer_rt.foundation.console import results, say
from observer_rt.foundation.errors import UserError, require
from observer_rt.foundation.options import Argument, Option


class ProjectStep(StrEnum):
    """What to do."""

    NEW = "new"
    FIT = "fit"
    EVALUATE = "evaluate"
    DISCOVER = "discover"
    REPORT = "report"


@dataclass(frozen=True)
class ProjectOptions:
    """Options of the command."""

    step: Annotated[
        ProjectStep,
        Argument("new, or a step; the steps it needs are done first.", "new|fit|evaluate|discover|report"),
    ]
    folder: Annotated[Path, Argument("Folder of the project.", "DIR")]
    model: Annotated[
        Path | None, Option("With new: injector file to begin with (default: the nominal injector).")
    ] = None


def project(options: ProjectOptions) -> None:
    """Keep fit, evaluation, discovery and report of an injector in a folder; repeat steps whose files changed."""
    from observer_rt.desk.project.project import PROJECT, Project

    if options.step is ProjectStep.NEW:
        made = Project.new(options.folder, options.model)
        say(
            results(),
            f"{made.folder / PROJECT}: put recordings into {options.folder}/healthy and {options.folder}/recordings",
        )
        return
    if options.model is not None:
        raise UserError("--model", "is for a new project", f"name it in {options.folder / PROJECT}")
    require("jinja2", "matplotlib")
    from observer_rt.desk.project.steps import do

    do(options.step, Project.read(options.folder), partial(say, messages))
