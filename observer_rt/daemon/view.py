"""The terminal view: state and inputs, an injection as curves, the recent ones; drawn of a snapshot."""

import math
import threading
from collections.abc import Callable
from datetime import UTC, datetime

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from observer_rt.daemon.arrivals import age_text
from observer_rt.daemon.shown_injections import HEADING, LOWEST, curves, injections
from observer_rt.daemon.snapshot import Snapshot, Status, StatusLevel
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.words import STATES, named

WIDEST = 200  # columns
FRAME = 4  # columns of the panel's border and padding
BORDER = 3  # lines of the panel's border, and one to spare
TABLE_SHARE = 0.3  # of the lines that curves and table have
FRAMES_PER_SECOND = 8
_BADGES = {StatusLevel.GOOD: "green", StatusLevel.WAITING: "yellow", StatusLevel.BAD: "red"}
_STYLES = {StatusLevel.GOOD: "dim", StatusLevel.WAITING: "yellow", StatusLevel.BAD: "bold red"}


class View:
    """Draws a daemon; `render` may be called from another thread than the daemon's."""

    def __init__(self, title: str, snapshot: Callable[[], Snapshot]) -> None:
        """snapshot: takes one of the daemon."""
        self._title = title
        self._snapshot = snapshot

    def render(self, width: int, height: int) -> RenderableType:
        """The whole view now, for a terminal of `width` x `height` characters."""
        snapshot, inner = self._snapshot(), max(1, min(width, WIDEST) - FRAME)
        status, shown = snapshot.status, snapshot.injections
        lines = [*_inputs(status), *(_line(f" {each.text}", each.level) for each in status.lines)]
        head = _heading(status, inner)
        drawn = len(Console(width=inner).render_lines(head))  # long reasons take more lines than one
        left = max(0, height - BORDER - len(lines) - drawn - HEADING)
        parts: list[RenderableType] = [head, *lines]
        if shown:
            rows = max(1, min(len(shown), round(TABLE_SHARE * left)))
            parts.append(curves(shown[-1], (inner, max(LOWEST, left - rows))))
            parts.append(injections(shown[-rows:], inner))
        else:
            parts.append(Text("no injection yet", style="dim"))
        return Panel(Group(*parts), title=self._title, expand=False)


def _heading(status: Status, width: int) -> Table:
    """State and reasons in words, and the clock."""
    state = State[status.state]
    line = Text()
    line.append(f" {state.name} ", f"bold white on {_BADGES[status.level]}")
    line.append(f" {STATES[state].what}")
    for reason in status.reasons:
        line.append(f"\n {named(Reason[reason])}", "yellow")
    grid = Table.grid(expand=False)
    clock = datetime.now(UTC).astimezone().strftime("%Y-%m-%d %H:%M:%S")
    grid.add_column(width=width - len(clock))
    grid.add_column(width=len(clock), no_wrap=True)
    grid.add_row(line, Text(clock, "bold"))
    return grid


def _line(text: str, level: StatusLevel = StatusLevel.GOOD) -> Text:
    return Text(text, _STYLES[level], no_wrap=True, overflow="ellipsis")


def _inputs(status: Status) -> list[Text]:
    lines = []
    for source in status.inputs:
        style = _STYLES[StatusLevel.BAD] if source.is_stale else ""
        text = _line(f" {source.text} ", StatusLevel.BAD if source.is_stale else StatusLevel.GOOD)
        text.append(age_text(math.nan if source.age is None else source.age), style)
        lines.append(text.append(source.lateness, "dim"))
    return lines


def draw(screen: View, until: threading.Event, console: Console) -> None:
    """Draw the view on a terminal until the event is set."""

    def picture() -> RenderableType:
        return screen.render(console.width, console.height)

    with Live(picture(), console=console, auto_refresh=False) as live:
        while not until.wait(1 / FRAMES_PER_SECOND):
            live.update(picture(), refresh=True)
        live.update(picture(), refresh=True)
    console.print()  # what is written next has a line of its own
