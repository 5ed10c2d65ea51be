"""Progress of long work on the screen, as bars on stderr."""

import contextlib
import threading
from collections.abc import Callable, Iterator
from importlib.util import find_spec

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn


@contextlib.contextmanager
def progress_bar(console: Console, text: str, total: float | None) -> Iterator[Callable[[float], None]]:
    """A bar that takes the progress so far, out of `total` (None: unknown); it disappears at the end.

    Bars of several threads stand below each other.
    """
    with _bars.on(console) as progress:
        task = progress.add_task(text, total=total)
        try:
            yield lambda done: progress.update(task, completed=done)
        finally:
            progress.remove_task(task)


class _Bars:
    """The one place where bars are drawn, as long as there are any."""

    def __init__(self) -> None:
        self._users = 0
        self._progress: Progress | None = None
        self._lock = threading.Lock()

    @contextlib.contextmanager
    def on(self, console: Console) -> Iterator[Progress]:
        """Display to which a bar is added, open as long as there are bars."""
        with self._lock:
            if self._progress is None:
                self._progress = _drawn_on(console)
                self._progress.start()
            self._users += 1
            progress = self._progress
        try:
            yield progress
        finally:
            with self._lock:
                self._users -= 1
                if self._users == 0:
                    self._progress = None
                    progress.stop()


_bars = _Bars()


def _drawn_on(console: Console) -> Progress:
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    is_seen = console.is_terminal or (console.is_jupyter and find_spec("ipywidgets") is not None)
    return Progress(*columns, console=console, transient=True, disable=not is_seen)
