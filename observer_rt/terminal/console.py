"""Results on stdout, progress bars and messages on stderr."""

import contextlib
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from observer_rt.foundation.compilation import compiled_code, is_compiled

COMPILING = "compiling for the first start of this version, which takes up to a minute"


@contextlib.contextmanager
def progress_bar(console: Console, text: str, total: float | None) -> Iterator[Callable[[float], None]]:
    """A bar that is told what is done so far, out of `total` (None: unknown); gone when done."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(text, total=total)
        yield lambda done: progress.update(task, completed=done)


def say(console: Console, text: str) -> None:
    """A message as it is: no markup, no colours, wrapped on a terminal only."""
    console.print(text, highlight=False, markup=False, emoji=False, soft_wrap=not console.is_terminal)


def say_if_compiling(console: Console) -> None:
    """Say why nothing happens for a while; to be called before the first compiled function."""
    if not is_compiled():
        say(console, COMPILING)
        if trouble := compiled_code().trouble:
            say(console, f"warning: {trouble}\n  remedy: {compiled_code().remedy}")


def results() -> Console:
    """Console for tables on stdout: as wide as they are when stdout is a file or a pipe."""
    console = Console()
    return console if console.is_terminal else Console(width=160)
