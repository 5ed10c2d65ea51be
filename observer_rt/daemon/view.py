"""The terminal view: state and inputs, and the recent injections; drawn of a snapshot."""

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from observer_rt.daemon.arrivals import age_text
from observer_rt.daemon.snapshot import ShownInjection, Snapshot, Status, StatusLevel
from observer_rt.engine.reports.injection_report import NAMED
from observer_rt.engine.stream.state import Reason, State
from observer_rt.engine.words import STATES, named

Values = Mapping[str, Any]
WIDEST = 200  # columns
FRAME = 4  # columns of the panel's border and padding
BORDER = 3  # lines of the panel's border, and one to spare
FRAMES_PER_SECOND = 8
_BADGES = {StatusLevel.GOOD: "green", StatusLevel.WAITING: "yellow", StatusLevel.BAD: "red"}
_STYLES = {StatusLevel.GOOD: "dim", StatusLevel.WAITING: "yellow", StatusLevel.BAD: "bold red"}

WITH_WORDS = 110  # columns, from which all columns have room, and reasons are put into words
HEADING = 2  # lines
_FIRST = [NAMED[name] for name in ("number", "rail_pressure_MPa", "mass_mg", "mass_bound_mg")]
_COMMAND = [NAMED["command"], NAMED["opening_delay_us"]]


class View:
    """Draws a daemon; `render` may be called from another thread than the daemon's."""

    def __init__(self, title: str, snapshot: Callable[[], Snapshot]) -> None:
        self._title = title
        self._snapshot = snapshot

    def render(self, width: int, height: int) -> RenderableType:
        """The whole view now, for a terminal of `width` x `height` characters."""
        snapshot, inner = self._snapshot(), max(1, min(width, WIDEST) - FRAME)
        status, shown = snapshot.status, snapshot.injections
        lines = [*_inputs(status), *(_line(f" {line.text}", line.level) for line in status.lines)]
        head = _heading(status, inner)
        drawn = len(Console(width=inner).render_lines(head))  # long reasons take more lines than one
        left = max(0, height - BORDER - len(lines) - drawn - HEADING)
        table = _injections(shown[-max(1, left) :], inner) if shown else Text("no injection yet", style="dim")
        return Panel(Group(head, *lines, table), title=self._title, expand=False)


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


def _injections(shown: Sequence[ShownInjection], width: int) -> Table:
    """Table of injections, the last one at the bottom; in 76 columns no figure is cut."""
    is_measured = any(item.values["measured_mass_mg"] is not None for item in shown)
    is_commanded = any(item.values["command"] is not None for item in shown)
    is_tight = width < WITH_WORDS and (is_measured or is_commanded)
    compared = () if is_tight else tuple(shown[-1].references)
    table = Table(box=None, padding=(0, 1 if is_tight else 2, 0, 0), pad_edge=False)
    names = [f"{name}\nmg" for name in compared]
    if is_measured:
        names += ["measured\nmg", "error\n%"]
    commanded = _COMMAND if is_commanded else []
    headings = [*(field.heading for field in _FIRST), *names, *(field.heading for field in commanded)]
    for heading in (*headings, "nozzle\nflow"):
        table.add_column(Text(heading), justify="right", no_wrap=True)
    table.add_column(Text("\nvalid?"), no_wrap=True)
    for item in shown:
        values, masses = item.values, (item.references.get(name) for name in compared)
        table.add_row(
            *(field.text(values[field.name]) for field in _FIRST),
            *("-" if mass is None else f"{mass:.2f}" for mass in masses),
            *(_measured(values) if is_measured else ()),
            *(field.text(values[field.name]) for field in commanded),
            _wear(values, not is_tight),
            _verdict(values, width >= WITH_WORDS),
        )
    return table


def _wear(values: Values, with_interval: bool) -> str:
    wear, high = values["nozzle_v_H"], values["nozzle_v_H_ci95_high"]
    return f"{wear:+.1%}{f' ±{high - wear:.1%}' if with_interval and high is not None else ''}"


def _verdict(values: Values, in_words: bool) -> Text:
    if values["valid"]:
        remainder = f", {values['remainder']}" if in_words and values["remainder"] else ""
        return Text(f"valid{remainder}", style="green" if values["verdict"] == "valid" else "yellow")
    names = values["reasons"].replace(",", ", ")
    words = values["verdict"].partition(": ")[2].partition(": ")[2]
    return Text(f"{names}: {words}" if in_words else names, style="yellow", overflow="ellipsis")


def _measured(values: Values) -> tuple[str, str]:
    mass = values["measured_mass_mg"]
    if mass is None:
        return "-", "-"
    estimate = math.nan if values["mass_mg"] is None else values["mass_mg"]
    return f"{mass:.2f}", f"{100 * (estimate / mass - 1.0):+.2f}"


def draw(screen: View, until: threading.Event, console: Console) -> None:
    """Draw the view on a terminal until the event is set."""

    def picture() -> RenderableType:
        return screen.render(console.width, console.height)

    with Live(picture(), console=console, auto_refresh=False) as live:
        while not until.wait(1 / FRAMES_PER_SECOND):
            live.update(picture(), refresh=True)
        live.update(picture(), refresh=True)
    console.print()  # what is written next has a line of its own
