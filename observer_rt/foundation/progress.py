"""Progress of long work on the screen, as bars on stderr."""

import contextlib
from collections.abc import Callable, Iterator
from importlib.util import find_spec

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn


@contextlib.contextmanager
def progress_bar(console: Console, text: str, total: float | None) -> Iterator[Callable[[float], None]]:
    """A bar that takes the progress so far, out of `total` (None: unknown); it disappears at the end."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    is_seen = console.is_terminal or (console.is_jupyter and find_spec("ipywidgets") is not None)
    with Progress(*columns, console=console, transient=True, disable=not is_seen) as progress:
        task = progress.add_task(text, total=total)
        yield lambda done: progress.update(task, completed=done)
