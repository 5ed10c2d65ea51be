"""What the commands of `tools/bench` share: options, names that are chosen, where tables and documents go."""

import json
import math
import os
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from observer_rt.foundation.errors import UserError

INTERRUPTED = 130  # exit code
TABLE_WIDTH = 210  # where stdout is no terminal
PROCESSES = os.cpu_count() or 1
messages = Console(stderr=True)


class Tier(StrEnum):
    """Which plant is measured. A: of the nominal structure; B: richer, with travelling waves."""

    A = "A"
    B = "B"


SeedOption = Annotated[int, typer.Option(help="Master seed.")]
WorkersOption = Annotated[int, typer.Option(min=1, help="Processes.")]
OutOption = Annotated[
    Path | None, typer.Option(help="Folder for results (default: in build/); a run interrupted goes on.")
]
TierOption = Annotated[
    Tier, typer.Option(help="A: a plant of the nominal structure. B: a richer one, to which `fit` fits.")
]
ModelOption = Annotated[
    Path | None, typer.Option(help="Tier B: injector file, instead of fitting one.", exists=True)
]
NoPeersOption = Annotated[bool, typer.Option("--no-peers", help="Only our observer.")]
JsonOption = Annotated[bool, typer.Option("--json", help="JSON on stdout.")]


def chosen_names(text: str, option: str, known: Collection[str], default: Collection[str]) -> tuple[str, ...]:
    """Names by commas, else the default. Raises `UserError` for one that is not known."""
    names = tuple(name.strip() for name in text.split(",") if name.strip()) or tuple(default)
    for name in names:
        if name not in known:
            raise UserError(option, f"unknown name '{name}'", f"known: {', '.join(known)}")
    return names


@contextmanager
def resumable(kept: str) -> Iterator[None]:
    """A run that the user may interrupt, and what is kept of it then."""
    try:
        yield
    except KeyboardInterrupt:
        messages.print(f"interrupted; {kept} kept, the same command goes on")
        raise typer.Exit(INTERRUPTED) from None


def put_out(
    as_json: bool,
    document: Callable[[], Any],
    show: Callable[[Console], None],
    width: int = TABLE_WIDTH,
) -> None:
    """The document as JSON on stdout, or what is shown on a screen."""
    if as_json:
        print(json.dumps(document(), indent=2))
    else:
        show(screen(width))


def screen(width: int = TABLE_WIDTH) -> Console:
    """Stdout; so many columns wide where it is no terminal."""
    console = Console()
    return console if console.is_terminal else Console(width=width)


def ruled(title: str, names: Sequence[str], numbers: Sequence[str], no_wrap: bool = False) -> Table:
    """A table with columns of names, which do not wrap, and of numbers, which may."""
    table = Table(title=title, title_justify="left")
    for heading in names:
        table.add_column(heading, no_wrap=True)
    for heading in numbers:
        table.add_column(heading, justify="right", no_wrap=no_wrap)
    return table


def print_lines(console: Console, lines: Iterable[str], title: str = "") -> None:
    """Each as it is, behind a title."""
    for line in lines:
        console.print(f"{title}{line}", highlight=False, markup=False)


def finite(value: Any) -> Any:
    """The same with None in the place of what is no finite number, which JSON does not know."""
    if isinstance(value, dict):
        return {key: finite(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
