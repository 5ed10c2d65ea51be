"""The terminal view, of one injector or several: state and inputs, an injection as curves, the recent ones."""

import threading
import time
from collections import deque
from collections.abc import Sequence
from typing import Protocol

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from observer_rt.config.bench import BenchInjector
from observer_rt.service.core.core import Core
from observer_rt.service.core.learners import noise_text
from observer_rt.service.daemon import Daemon
from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.reports.news import MeasuredMass, News
from observer_rt.service.screen.curves import (
    HEADING,
    LOWEST,
    NominalInjection,
    References,
    ShownInjection,
    curves,
    injections,
    last_injection,
)
from observer_rt.service.screen.status import heading, lines
from observer_rt.service.words import is_good

REMEMBERED = 40  # injections
WIDEST = 200  # columns
FRAME = 4  # columns of the panel's border and padding
BORDER = 3  # lines of the panel's border, and one to spare
TABLE_SHARE = 0.3  # of the lines that curves and table have
NOISE_EVERY = 5_000_000_000  # ns between two looks at the spectrum of the noise


class View:
    """Listens to a daemon's injections and draws them; `render` may be called from another thread."""

    def __init__(self, title: str, fitted: BenchInjector, references: References | None = None) -> None:
        """references: worked out when drawn, not on the loop's time; None: the model as given."""
        nominal = NominalInjection(fitted)
        self._title = title
        self._name = fitted.name
        self._sample_rate = fitted.config.sampling.rate_hz
        self._coefficients = nominal.coefficients
        self._references: References = references or nominal
        self._shown: deque[ShownInjection] = deque(maxlen=REMEMBERED)
        self._daemon: Daemon | None = None
        self._noise_text, self._noise_due = "", 0

    def watch(self, daemon: Daemon) -> None:
        """Show this daemon's state and curves."""
        self._daemon = daemon

    def hear(self, news: News) -> None:
        """Take in an injection, and later its measured mass; a listener."""
        if isinstance(news, InjectionReport) and self._daemon is not None:
            self._shown.append(ShownInjection(news, self._daemon.core.rows(news.start, news.end + 1)))
        elif isinstance(news, MeasuredMass):
            for shown in self._shown:
                if shown.report is news.report:
                    shown.measured = news

    def summary(self, now: int) -> tuple[Text, ...]:
        """Injector, state, reason and the last injection: cells of a row."""
        name = Text(self._name)
        if self._daemon is None:
            return name, Text("starting", "dim")
        state, reasons = self._daemon.standing(now)
        cells = (
            name,
            Text(state.name, "green" if is_good(state) else "red"),
            Text(", ".join(reason.name for reason in reasons), "yellow"),
        )
        return (*cells, *last_injection(self._shown[-1], self._coefficients)) if self._shown else cells

    def render(self, now: int, width: int, height: int) -> RenderableType:
        """The whole view at a monotonic time [ns], for a terminal of `width` x `height` characters."""
        inner = max(1, min(width, WIDEST) - FRAME)
        if self._daemon is None:
            return Panel(Text("starting", style="dim"), title=self._title, expand=False)
        said = [*lines(self._daemon, now, height), *self._noise_line(self._daemon.core, now)]
        head = heading(self._daemon, now, inner)
        drawn = len(Console(width=inner).render_lines(head))  # long reasons take more lines than one
        left = max(0, height - BORDER - len(said) - drawn - HEADING)
        parts: list[RenderableType] = [head, *said]
        shown = list(self._shown)
        if shown:
            rows = max(1, min(len(shown), round(TABLE_SHARE * left)))
            for item in shown[-rows:]:
                if item.references is None:
                    item.references = self._references(item.report, item.rows)
            size = inner, max(LOWEST, left - rows)
            parts.append(curves(shown[-1], self._coefficients, self._sample_rate, size))
            parts.append(injections(shown[-rows:], inner, self._coefficients))
        else:
            parts.append(Text("no injection yet", style="dim"))
        return Panel(Group(*parts), title=self._title, expand=False)

    def _noise_line(self, core: Core, now: int) -> list[Text]:
        """What the noise is like, looked at every few seconds."""
        white = core.standstill.noise
        if white is None:
            return []
        if now >= self._noise_due:
            self._noise_text = noise_text(white, core.slow_noise)
            self._noise_due = now + NOISE_EVERY
        return [Text(f" noise: {self._noise_text}", "dim", no_wrap=True, overflow="ellipsis")]


FRAMES_PER_SECOND = 8


class Screen(Protocol):
    """What can be drawn."""

    def render(self, now: int, width: int, height: int) -> RenderableType:
        """At a monotonic time [ns], for a terminal of `width` x `height` characters."""


def draw(screen: Screen, until: threading.Event, console: Console) -> None:
    """Draw the view on a terminal until the event is set."""

    def picture() -> RenderableType:
        return screen.render(time.monotonic_ns(), console.width, console.height)

    with Live(picture(), console=console, auto_refresh=False) as live:
        while not until.wait(1 / FRAMES_PER_SECOND):
            live.update(picture(), refresh=True)
        live.update(picture(), refresh=True)


TURN = 5_000_000_000  # ns, for which one injector is shown
_HEADINGS = ("injector", "state", "reason", "no", "mass mg", "95 %", "v_H", "valid?")
_BORDER = 2  # lines: the headings, and one to spare


class Overview:
    """Draws the views of all injectors; `render` may be called from another thread."""

    def __init__(self, views: Sequence[View]) -> None:
        self._views = views

    def render(self, now: int, width: int, height: int) -> RenderableType:
        """All of it at a monotonic time [ns], for a terminal of `width` x `height` characters."""
        shown = now // TURN % len(self._views)
        table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
        for title in _HEADINGS:
            table.add_column(title, no_wrap=True)
        for number, view in enumerate(self._views):
            table.add_row(*view.summary(now), style="bold" if number == shown else "")
        whole = self._views[shown].render(now, width, height - len(self._views) - _BORDER)
        return Group(table, Text(), whole)
