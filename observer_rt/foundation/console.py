"""Screen and signals: results on stdout, progress and messages on stderr; suffixes of files."""

import contextlib
import os
import re
import signal
import threading
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from time import monotonic
from typing import Literal

from rich.console import Console
from rich.table import Table
from rich.text import Text

from observer_rt.foundation.errors import UserError

FIGURE_SUFFIXES = (".png", ".svg", ".pdf")
SILENCE = 30.0  # s between lines of progress where no bar is seen


def visible(text: str) -> str:
    """The text with control characters, such as a file name may hold for the terminal to obey, as escapes."""
    return re.sub(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]", lambda sign: ascii(sign[0])[1:-1], text)


def say(console: Console, text: str) -> None:
    """A message as it is: no markup, no colours, wrapped on a terminal only."""
    console.print(visible(text), highlight=False, markup=False, emoji=False, soft_wrap=not console.is_terminal)


def results() -> Console:
    """Console for tables on stdout: as wide as they are when stdout is a file or a pipe."""
    console = Console()
    return console if console.is_terminal else Console(width=160)


def plain_table(
    headings: Sequence[str],
    rows: Iterable[Sequence[str | Text]],
    right: Collection[int] = (),
    folds: Collection[int] | None = None,
    gap: int = 2,
) -> Table:
    """A table without lines. right: columns of numbers; folds: columns that a narrow terminal breaks, None: all."""
    table = Table(box=None, padding=(0, gap, 0, 0), pad_edge=False)
    for column, heading in enumerate(headings):
        justify: Literal["left", "right"] = "right" if column in right else "left"
        is_fixed = folds is not None and column not in folds
        table.add_column(
            Text(heading), justify=justify, no_wrap=is_fixed, overflow="ellipsis" if is_fixed else "fold"
        )
    for row in rows:
        table.add_row(*(cell if isinstance(cell, Text) else Text(visible(cell)) for cell in row))
    return table


def check_suffix(location: str, path: Path, suffixes: Collection[str]) -> None:
    """Raise `UserError` for a file whose suffix is not among those known."""
    suffix = path.suffix.lower()
    if suffix not in suffixes:
        raise UserError(location, f"unknown kind of file '{suffix}'", f"known suffixes: {', '.join(suffixes)}")


@contextlib.contextmanager
def progress_bar(console: Console, text: str, total: float | None) -> Iterator[Callable[[float], None]]:
    """A bar that takes the progress so far, out of `total` (None: unknown); it disappears at the end."""
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}", markup=False), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
    is_seen = console.is_terminal or (console.is_jupyter and find_spec("ipywidgets") is not None)
    with Progress(*columns, console=console, transient=True, disable=not is_seen) as progress:
        task = progress.add_task(visible(text), total=total)
        last_line = monotonic()

        def update(done: float) -> None:
            nonlocal last_line
            progress.update(task, completed=done)
            if not is_seen and monotonic() - last_line > SILENCE:
                last_line = monotonic()
                say(console, text if total is None else f"{text}: {done / total:.0%}")

        yield update


class SignalledEvent(threading.Event):
    """An event that a signal's handler may set in the midst of a wait for it: its lock is re-entrant."""

    def __init__(self) -> None:
        super().__init__()
        self._cond = threading.Condition(threading.RLock())


class StopRequest(SignalledEvent):
    """Set by the first signal that ends a command; the next one interrupts it.

    reload: set by SIGHUP where it has files read again.
    """

    def __init__(self) -> None:
        super().__init__()
        self.reload = threading.Event()
        self._parts: list[threading.Event] = []

    @contextlib.contextmanager
    def setting(self, part: threading.Event) -> Iterator[None]:
        """While it lasts, the end of a part of the command is set with its own."""
        self._parts.append(part)
        if self.is_set():
            part.set()
        try:
            yield
        finally:
            self._parts.remove(part)

    def end(self, *_: object) -> None:
        """Set this event and the events that end with it."""
        self.set()
        for part in self._parts:
            part.set()

    def end_or_interrupt(self, *_: object) -> None:
        """End at the first call; raise `KeyboardInterrupt` at the second."""
        if self.is_set():
            raise KeyboardInterrupt
        self.end()


@contextlib.contextmanager
def stop_on_signals(reloads: bool = False) -> Iterator[StopRequest]:
    """An event that the first SIGINT or SIGTERM sets while the context lasts, and SIGHUP unless it is ignored.

    reloads: SIGUSR1 asks to read files again, and SIGHUP where no terminal can hang up.
    """
    stop = StopRequest()
    handlers: dict[signal.Signals, Callable[..., None]] = dict.fromkeys(
        (signal.SIGINT, signal.SIGTERM), stop.end_or_interrupt
    )
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # as under nohup
        is_asked = reloads and not any(map(os.isatty, range(3)))
        # a shell and the kernel both send it when a terminal is closed
        handlers[signal.SIGHUP] = (lambda *_: stop.reload.set()) if is_asked else stop.end
    if reloads:
        handlers[signal.SIGUSR1] = lambda *_: stop.reload.set()
    previous = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield stop
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
