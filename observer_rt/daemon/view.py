"""The terminal view: state and inputs, an injection as curves, the recent ones."""

import math
import threading
import time
from collections import deque
from datetime import UTC, datetime

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from observer_rt.bus.alignment.timekeeping import LARGEST_DRIFT, MessageTiming
from observer_rt.bus.links.descriptor import IdleLink
from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import Role
from observer_rt.daemon.daemon import Daemon
from observer_rt.daemon.input_monitoring.arrivals import age_text
from observer_rt.daemon.nominal import NominalInjection, References
from observer_rt.daemon.shown_injections import (
    HEADING,
    LOWEST,
    ShownInjection,
    curves,
    injections,
)
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.reports.news import MeasuredMass, News
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.learners import noise_text
from observer_rt.engine.words import REASONS, STATES, is_good
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND, MILLISECOND, ZERO_CELSIUS

REMEMBERED = 40  # injections
WIDEST = 200  # columns
FRAME = 4  # columns of the panel's border and padding
BORDER = 3  # lines of the panel's border, and one to spare
TABLE_SHARE = 0.3  # of the lines that curves and table have
NOISE_EVERY = 5_000_000_000  # ns between two looks at the spectrum of the noise
FEW_LINES = 30  # of a terminal, below which inputs that are well share a line
PAUSE = 10 * MILLISECOND  # lateness that is none of a bus
FRAMES_PER_SECOND = 8


class View:
    """Listens to a daemon's injections and draws them; `render` may be called from another thread."""

    def __init__(self, title: str, fitted: BenchInjector, references: References | None = None) -> None:
        """references: worked out when drawn, not on the loop's time; None: the model as given."""
        nominal = NominalInjection(fitted)
        self._title = title
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
        """Takes in an injection, and later its measured mass; a listener."""
        if isinstance(news, InjectionReport) and self._daemon is not None:
            self._shown.append(ShownInjection(news, self._daemon.core.rows(news.start, news.end + 1)))
        elif isinstance(news, MeasuredMass):
            for shown in self._shown:
                if shown.report is news.report:
                    shown.measured = news

    def render(self, now: int, width: int, height: int) -> RenderableType:
        """The whole view at a monotonic time [ns], for a terminal of `width` x `height` characters."""
        inner = max(1, min(width, WIDEST) - FRAME)
        if self._daemon is None:
            return Panel(Text("starting", style="dim"), title=self._title, expand=False)
        lines = [*_inputs(self._daemon, now, height), *_links(self._daemon), *_figures(self._daemon)]
        lines += self._noise_line(self._daemon.core, now)
        head = _heading(self._daemon, now, inner)
        drawn = len(Console(width=inner).render_lines(head))  # long reasons take more lines than one
        left = max(0, height - BORDER - len(lines) - drawn - HEADING)
        parts: list[RenderableType] = [head, *lines]
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
        """Describes the noise, looked at every few seconds."""
        white = core.standstill.noise
        if white is None:
            return []
        if now >= self._noise_due:
            self._noise_text = noise_text(white, core.slow_noise)
            self._noise_due = now + NOISE_EVERY
        return [_line(f" noise: {self._noise_text}")]


def _heading(daemon: Daemon, now: int, width: int) -> Table:
    """State and reasons in words, and the clock."""
    state, reasons = daemon.standing(now)
    line = Text()
    line.append(f" {state.name} ", "bold white on green" if is_good(state) else "bold white on red")
    line.append(f" {STATES[state].what}")
    for reason in reasons:
        line.append(f"\n {reason.name}: {REASONS[reason].what}", "yellow")
    grid = Table.grid(expand=False)
    clock = datetime.now(UTC).astimezone().strftime("%Y-%m-%d %H:%M:%S")
    grid.add_column(width=width - len(clock))
    grid.add_column(width=len(clock), no_wrap=True)
    grid.add_row(line, Text(clock, "bold"))
    return grid


def _line(text: str, style: str = "dim") -> Text:
    return Text(text, style, no_wrap=True, overflow="ellipsis")


def _inputs(daemon: Daemon, now: int, height: int) -> list[Text]:
    arrivals = daemon.arrivals
    stale = arrivals.stale(now)
    timing = daemon.core.timing
    if height < FEW_LINES and not stale and arrivals.is_complete and not arrivals.is_contested(now):
        oldest = max(arrivals.age_of(role, now) for role in Role)
        return [_line(f" all inputs come, the oldest {age_text(oldest)}{_late(timing)}")]
    lines = []
    for source in arrivals.sources:
        late = "" if source in stale else _late([timing[stream] for stream in source.streams])
        text = _line(f" {source.text} ", "bold red" if source in stale else "dim")
        text.append(age_text(arrivals.age(source, now)), "bold red" if source in stale else "")
        lines.append(text.append(late, "dim"))
    if arrivals.is_contested(now):
        lines.append(_line(f" another node sends our results: {arrivals.foreign_frames} frames", "bold red"))
    return lines


def _late(timing: list[MessageTiming] | tuple[MessageTiming, ...]) -> str:
    """Describes how late frames come, and how well the time of their samples is known."""
    if not timing or any(one.jitter.frames == 0 for one in timing):
        return ""
    lately = max(one.lately for one in timing)
    text = f", late by up to {lately / MICROSECOND:.0f} us" if lately < PAUSE else ", comes in bursts"
    drift = max((one.drift for one in timing), key=abs)
    if abs(drift) >= LARGEST_DRIFT:
        text += f", at {1.0 / (1.0 + drift):.3g} times real time"
    unknown = max(one.unknown for one in timing)
    if unknown == math.inf:
        text += ", clocks not known yet"
    elif unknown > 0.0:
        error = max(one.pressure_error for one in timing)
        text += f"; joined by clock, known to {unknown / MICROSECOND:.2g} us ({error / MEGAPASCAL:.2g} MPa)"
    return text


def _links(daemon: Daemon) -> list[Text]:
    lines = []
    for port in daemon.ports:
        if isinstance(port.link, IdleLink):
            continue
        condition = str(port.link.condition.state) if port.is_up else "down"
        lines.append(
            _line(
                f" {port.label} {condition}, stamps by {port.link.stamp_source}; lost here {port.link.dropped}, "
                f"unsent {port.unsent}, outages {port.troubles}",
                "bold red" if port.is_in_trouble else "dim",
            )
        )
    return lines


def _figures(daemon: Daemon) -> list[Text]:
    core = daemon.core
    counters = core.counters
    damaged = counters.crc_errors + counters.length_errors
    lines = [
        _line(
            f" {counters.samples} samples, {counters.lost_samples} missing; frames: {damaged} damaged, "
            f"{counters.sequence_errors} out of order, {counters.old_frames} too late"
        )
    ]
    if daemon.latency is not None:
        lines.append(_line(f" {daemon.latency.as_text()}"))
    if counters.outliers:
        lines.append(_line(f" {counters.outliers}"))
    refused = f"{counters.rejected_adoptions} refused, {counters.late_adoptions} late"
    if counters.passed_over:
        refused += f", {counters.passed_over} events passed over"
    learned = f" learned {counters.adoptions} times in {counters.events} events ({refused})"
    lines.append(_line(learned if core.optional.learning else f"{learned}; learning is off"))
    if core.optional.fuel_temperature is not None:
        lines[-1].append(f"; fuel {core.optional.fuel_temperature - ZERO_CELSIUS:.1f} °C")
    if core.optional.energizing is not None:
        is_odd = core.optional.energizing.missing > 0 or core.optional.energizing.uncommanded > 0
        lines.append(_line(f" {core.optional.energizing.as_text()}", "yellow" if is_odd else "dim"))
    if daemon.failed_writes:
        text = f" {daemon.failed_writes} failed writes of learned state, journal or log, which says why"
        lines.append(_line(text, "bold red"))
    return lines


def draw(screen: View, until: threading.Event, console: Console) -> None:
    """Draw the view on a terminal until the event is set."""

    def picture() -> RenderableType:
        return screen.render(time.monotonic_ns(), console.width, console.height)

    with Live(picture(), console=console, auto_refresh=False) as live:
        while not until.wait(1 / FRAMES_PER_SECOND):
            live.update(picture(), refresh=True)
        live.update(picture(), refresh=True)
    console.print()  # what is written next has a line of its own
