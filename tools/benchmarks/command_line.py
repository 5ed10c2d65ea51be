"""What the commands of `tools/bench` share: the program they belong to, options, names that are chosen."""

import os
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, TypeVar

import typer
from rich.console import Console

from observer_rt.foundation.console import progress_bar
from observer_rt.foundation.errors import UserError

Item = TypeVar("Item")
INTERRUPTED = 130  # exit code
PROCESSES = os.cpu_count() or 1
messages = Console(stderr=True)
app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


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


def tracked(items: Iterable[Item], what: str, total: int | None = None) -> Iterator[Item]:
    """Item by item, a bar among the messages meanwhile; total: of items that have no length."""
    count = len(items) if isinstance(items, Collection) else total
    with progress_bar(messages, what, count) as progress:
        for number, item in enumerate(items, 1):
            yield item
            progress(float(number))


def tell_figures(files: Iterable[Path]) -> None:
    """Say which figures were drawn."""
    for file in files:
        messages.print(f"figure: {file}", highlight=False)
