"""The terminal view: the last injection as a curve, the recent ones as a table, counters of the bus."""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import plotext
from numpy.typing import NDArray
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from observer_rt.bus.alignment.message_timing import summary_of
from observer_rt.estimation.scalars import NOZZLE
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND, MILLIGRAM, MM3_PER_MS, ZERO_CELSIUS
from observer_rt.service.daemon import Daemon
from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.reports.news import MeasuredMass, News

SHOWN = 8  # injections in the table, where the terminal has the lines
WIDEST, HIGHEST = 120, 18  # characters, of the view and its plot
AROUND = 4  # characters beside the plot: the panel's border and padding
ABOVE = 10  # lines for the panel's border, the status, the table's heading and a line to spare
LOWEST = 6  # lines of the plot


@dataclass(frozen=True)
class Reference:
    """What an injection can be compared with: its rate [m3/s] over the injection's samples, and its mass [kg]."""

    name: str
    rate: NDArray[np.float64]
    mass: float


@dataclass(frozen=True)
class _Shown:
    report: InjectionReport
    rate: NDArray[np.float64]
    references: Sequence[Reference]
    measured: MeasuredMass | None = None


class View:
    """Listens to a daemon's injections and draws them; `render` may be called from another thread."""

    def __init__(
        self,
        title: str,
        sample_rate: float,
        references: Callable[[InjectionReport], Sequence[Reference]] | None = None,
    ) -> None:
        self._title = title
        self._sample_rate = sample_rate
        self._references = references or (lambda _: ())
        self._shown: deque[_Shown] = deque(maxlen=SHOWN)
        self._daemon: Daemon | None = None

    def watch(self, daemon: Daemon) -> None:
        """Show this daemon's state and curves."""
        self._daemon = daemon

    def hear(self, news: News) -> None:
        """Take in an injection, and later its measured mass; a listener."""
        if isinstance(news, InjectionReport) and self._daemon is not None:
            self._take_in(news, self._daemon)
        elif isinstance(news, MeasuredMass):
            for place, shown in enumerate(self._shown):
                if shown.report is news.report:
                    self._shown[place] = replace(shown, measured=news)

    def _take_in(self, report: InjectionReport, daemon: Daemon) -> None:
        rate = daemon.core.rows(report.start, report.end + 1)["injection_rate"].copy()
        self._shown.append(_Shown(report, rate, self._references(report)))

    def render(self, now: int, width: int, height: int) -> RenderableType:
        """The whole view at a monotonic time [ns], for a terminal of `width` x `height` characters."""
        shown = list(self._shown)
        further = 0
        if self._daemon is not None:
            further = len(self._daemon.ports) - 1 + (self._daemon.core.energizing is not None)
        lines = max(0, height - ABOVE - further)
        rows = max(1, min(SHOWN, lines // 3))
        size = min(width, WIDEST) - AROUND, max(LOWEST, min(HIGHEST, lines - rows))
        parts: list[RenderableType] = [self._status(now)]
        if shown:
            parts += [Text.from_ansi(_plot(shown[-1], self._sample_rate, size)), _table(shown[-rows:])]
        else:
            parts.append(Text("no injection yet", style="dim"))
        return Panel(Group(*parts), title=self._title, expand=False)

    def _status(self, now: int) -> RenderableType:
        if self._daemon is None:
            return Text("starting", style="dim")
        counters = self._daemon.core.counters
        state, reason = self._daemon.state(now)
        good = state.name in ("RUNNING_NOMINAL", "ADAPTED")
        line = Text()
        line.append(f" {state.name} ", style="bold white on green" if good else "bold white on red")
        if reason:
            line.append(f" {reason.name}", style="yellow")
        is_off = "" if self._daemon.core.learning else " off"
        line.append(
            f"  learning{is_off}: {counters.adoptions} adopted, {counters.rejected_adoptions} rejected, "
            f"{counters.late_adoptions} late\n"
        )
        line.append(
            f" frames {counters.frames}  samples {counters.samples}  lost {counters.lost_samples}  "
            f"dropped {self._daemon.dropped}  CRC {counters.crc_errors}  sequence {counters.sequence_errors}\n",
            style="dim",
        )
        for port in self._daemon.ports:
            name = "link" if len(self._daemon.ports) == 1 else f"{port.label} dropped {port.link.dropped},"
            condition = str(port.link.condition.state) if port.is_up else "down"
            line.append(
                f" {name} {condition}, stamps by {port.link.stamp_source}, unsent {port.unsent}, "
                f"troubles {port.troubles}\n",
                style="bold red" if port.is_in_trouble else "dim",
            )
        line.append(f" {summary_of(self._daemon.core.timing)}", style="dim")
        temperature = self._daemon.core.fuel_temperature
        if temperature is not None:
            line.append(f"  fuel {temperature - ZERO_CELSIUS:.1f} °C", style="dim")
        energizing = self._daemon.core.energizing
        if energizing is not None:
            is_odd = energizing.missing > 0 or energizing.uncommanded > 0
            line.append(f"\n {energizing.as_text()}", style="yellow" if is_odd else "dim")
        return line


def _plot(shown: _Shown, sample_rate: float, size: tuple[int, int]) -> str:
    """Curves of one injection as ANSI text of `size` (columns, lines)."""
    time = np.arange(len(shown.rate)) / sample_rate / (1000 * MICROSECOND)
    plotext.clear_figure()
    plotext.plotsize(*size)
    plotext.theme("clear")
    curves = [(reference.name, reference.rate) for reference in shown.references]
    for name, rate in [*curves, ("estimated", shown.rate)]:
        known = ~np.isnan(rate)
        plotext.plot(time[known].tolist(), (rate[known] / MM3_PER_MS).tolist(), label=name, marker="braille")
    plotext.xlabel("time [ms]")
    plotext.ylabel("injection rate [mm3/ms]")
    plotext.title(f"injection {shown.report.number} at {shown.report.rail_pressure / MEGAPASCAL:.0f} MPa")
    return str(plotext.build())


def _table(shown: Sequence[_Shown]) -> Table:
    table = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
    names = [f"{reference.name}\nmg" for reference in shown[-1].references]
    is_measured = any(item.measured for item in shown)
    if is_measured:
        names += ["measured\nmg", "error\n%"]
    is_commanded = any(item.report.commanded for item in shown)
    if is_commanded:
        names += ["command\nno", "delay\nus"]
    for heading in ("\nno", "rail\nMPa", "mass\nmg", *names, "v_H\n-", ""):
        table.add_column(Text(heading), justify="right", no_wrap=True)
    for item in shown:
        report = item.report
        wear = report.indicators[NOZZLE]
        sigma = "" if wear.sigma is None else f" ±{1.96 * wear.sigma:.3f}"
        table.add_row(
            str(report.number),
            f"{report.rail_pressure / MEGAPASCAL:.1f}",
            f"{report.mass / MILLIGRAM:.2f}",
            *(f"{reference.mass / MILLIGRAM:.2f}" for reference in item.references),
            *(_measured(item) if is_measured else ()),
            *(_commanded(item.report) if is_commanded else ()),
            f"{wear.value:+.3f}{sigma}",
            "[green]valid" if report.valid else f"[yellow]{report.reason.name}",
        )
    return table


def _measured(shown: _Shown) -> tuple[str, str]:
    """Measured mass, and the error of the estimate."""
    if shown.measured is None:
        return "-", "-"
    return f"{shown.measured.mass / MILLIGRAM:.2f}", f"{100 * shown.measured.error:+.2f}"


def _commanded(report: InjectionReport) -> tuple[str, str]:
    """Number of the command, and opening delay."""
    commanded = report.commanded
    if commanded is None:
        return "-", "-"
    delay = commanded.opening_delay
    return str(commanded.command), "-" if math.isnan(delay) else f"{delay / MICROSECOND:.0f}"
