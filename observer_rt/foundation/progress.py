"""Progress of long work: bars on the screen, else a line now and then, on stderr."""

import contextlib
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from time import monotonic

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from observer_rt.foundation.console import say

SILENCE = 30.0  # s between lines where no bar is seen


@contextlib.contextmanager
def progress_bar(console: Console, text: str, total: float | None) -> Iterator[Callable[[float], None]]:
    """A bar that takes the progress so far, out of `total` (None: unknown); it disappears at the end."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    is_seen = console.is_terminal or (console.is_jupyter and find_spec("ipywidgets") is not None)
    with Progress(*columns, console=console, transient=True, disable=not is_seen) as progress:
        task = progress.add_task(text, total=total)
        said = monotonic()

        def update(done: float) -> None:
            nonlocal said
            progress.update(task, completed=done)
            if not is_seen and monotonic() - said > SILENCE:
                said = monotonic()
                say(console, text if total is None else f"{text}: {done / total:.0%}")

        yield update
