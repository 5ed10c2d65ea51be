"""Output on the screen: tables of results on stdout, progress and messages on stderr."""

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from time import monotonic
from typing import Literal

from rich.console import Console
from rich.table import Table
from rich.text import Text

SILENCE = 30.0  # s between lines of progress where no bar is seen


def visible(text: str) -> str:
    """The text with escapes for its control characters, which a file name may hold and a terminal would obey."""
    return re.sub(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]", lambda sign: ascii(sign[0])[1:-1], text)


def say(console: Console, text: str) -> None:
    """Print a message without markup or colours, wrapped on a terminal only."""
    console.print(visible(text), highlight=False, markup=False, emoji=False, soft_wrap=not console.is_terminal)


def results() -> Console:
    """Console for tables on stdout: of the terminal's width, or of 160 columns for a file or a pipe."""
    console = Console()
    return console if console.is_terminal else Console(width=160)


def plain_table(
    headings: Sequence[str],
    rows: Iterable[Sequence[str | Text]],
    right: Collection[int] = (),
    folds: Collection[int] | None = None,
    gap: int = 2,
    title: str | None = None,
) -> Table:
    """A table without lines; right: columns of numbers; folds: columns to break, None: all; gap: blanks between."""
    table = Table(box=None, padding=(0, gap, 0, 0), pad_edge=False, title=title, title_justify="left")
    for column, heading in enumerate(headings):
        side: Literal["left", "right"] = "right" if column in right else "left"
        is_fixed = folds is not None and column not in folds
        table.add_column(Text(heading), justify=side, no_wrap=is_fixed, overflow="ellipsis" if is_fixed else "fold")
    for row in rows:
        table.add_row(*(cell if isinstance(cell, Text) else Text(visible(cell)) for cell in row))
    return table


@contextmanager
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
