"""Results on stdout, progress bars and messages on stderr."""

import contextlib
import threading
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn


@contextlib.contextmanager
def progress_bar(console: Console, text: str, total: float | None) -> Iterator[Callable[[float], None]]:
    """A bar that is told what is done so far, out of `total` (None: unknown); gone when done.

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
        """Where to add a bar."""
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
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)


def say(console: Console, text: str) -> None:
    """A message as it is: no markup, no colours, wrapped on a terminal only."""
    console.print(text, highlight=False, markup=False, emoji=False, soft_wrap=not console.is_terminal)


def results() -> Console:
    """Console for tables on stdout: as wide as they are when stdout is a file or a pipe."""
    console = Console()
    return console if console.is_terminal else Console(width=160)
