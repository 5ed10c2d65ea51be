"""Injections on the terminal: the recent ones as a table, one as curves of rate and line pressure."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import plotext
from numpy.typing import NDArray
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from observer_rt.daemon.nominal import ComparedRate
from observer_rt.engine.estimation.scalars import NOZZLE
from observer_rt.engine.reports.injection_report import NAMED, InjectionReport
from observer_rt.engine.reports.news import MeasuredMass
from observer_rt.engine.words import REASONS
from observer_rt.foundation.units import MEGAPASCAL, MILLIGRAM, MILLISECOND, MM3_PER_MS
from observer_rt.model.effective import Coefficients

LOWEST = 6  # lines of a plot
SIDE_BY_SIDE = 130  # columns
STACKED = 20  # lines, from which there is room for two plots
_BAND, _ESTIMATE, _MEASURED = "gray", "green+", "cyan"
_REFERENCES = ("orange", "magenta")
_STYLES = {"gray": "dim", "green+": "bright_green", "cyan": "cyan", "orange": "yellow", "magenta": "magenta"}

WITH_WORDS = 110  # columns, from which all columns have room, and reasons are put into words
HEADING = 2  # lines
_FIRST = [NAMED[name] for name in ("number", "rail_pressure_MPa", "mass_mg", "mass_bound_mg")]
_COMMAND = [NAMED["command"], NAMED["opening_delay_us"]]


@dataclass
class ShownInjection:
    """An injection, its samples, what it is compared with (None: not worked out yet), its measured mass."""

    report: InjectionReport
    rows: NDArray[np.void]
    references: Sequence[ComparedRate] | None = None
    measured: MeasuredMass | None = None


class _CurveLine(NamedTuple):
    name: str
    colour: str  # as plotext calls it
    values: NDArray[np.float64]


def curves(
    shown: ShownInjection, c: Coefficients, sample_rate: float, size: tuple[int, int]
) -> RenderableType:
    """Plots in so many columns and lines; c: of the model."""
    width, height = size
    time = np.arange(len(shown.rows)) / sample_rate / MILLISECOND
    if width >= SIDE_BY_SIDE:
        half = (width - 2) // 2
        grid = Table.grid(padding=(0, 1))
        grid.add_row(_rate(shown, time, (half, height)), _pressure(shown, c, time, (half, height)))
        return grid
    if height >= STACKED:
        upper = round(0.6 * height)
        return Group(_rate(shown, time, (width, upper)), _pressure(shown, c, time, (width, height - upper)))
    return _rate(shown, time, size)


def _rate(shown: ShownInjection, time: NDArray[np.float64], size: tuple[int, int]) -> RenderableType:
    report, rate = shown.report, shown.rows["injection_rate"] / MM3_PER_MS
    lines = []
    if report.rate_sigma is not None:
        half = 1.96 * report.rate_sigma / MM3_PER_MS
        lines += [_CurveLine("95 % band", _BAND, rate - half), _CurveLine("", _BAND, rate + half)]
    for reference, colour in zip(shown.references or (), _REFERENCES, strict=False):
        lines.append(_CurveLine(reference.name, colour, reference.rate / MM3_PER_MS))
    lines.append(_CurveLine("observer", _ESTIMATE, rate))
    title = f"injection {report.number} at {report.rail_pressure / MEGAPASCAL:.0f} MPa, mm3/ms over ms:"
    return _plot(title, time, lines, size)


def _pressure(
    shown: ShownInjection, c: Coefficients, time: NDArray[np.float64], size: tuple[int, int]
) -> RenderableType:
    def absolute(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return (values * c.pressure_scale + c.chamber_pressure) / MEGAPASCAL

    model, measured = absolute(shown.rows["x_hat"][:, 0]), absolute(shown.rows["line_pressure"])
    furthest = float(np.max(np.abs(model - measured)))
    lines = [_CurveLine("observer", _ESTIMATE, model), _CurveLine("sensor", _MEASURED, measured)]
    return _plot(f"line pressure, MPa over ms, {furthest:.1f} MPa apart:", time, lines, size)


def _plot(
    title: str, time: NDArray[np.float64], lines: Sequence[_CurveLine], size: tuple[int, int]
) -> RenderableType:
    """Lines below a heading that names them in their colours; later ones cover earlier ones."""
    plotext.clear_figure()
    plotext.limit_size(False, False)
    plotext.plotsize(size[0], size[1] - 1)
    plotext.theme("clear")
    heading = Text(f" {title}", no_wrap=True, overflow="ellipsis")
    for line in lines:
        known = ~np.isnan(line.values)
        values = line.values[known].tolist()
        plotext.plot(time[known].tolist(), values, marker="braille", color=line.colour)
        if line.name:
            heading.append(f"  {line.name}", _STYLES[line.colour])
    return Group(heading, Text.from_ansi(str(plotext.build()).rstrip("\n")))


def injections(shown: Sequence[ShownInjection], width: int, c: Coefficients) -> Table:
    """Table of injections, the last one at the bottom; in 76 columns no figure is cut. c: of the nominal model."""
    is_measured = any(item.measured for item in shown)
    is_commanded = any(item.report.commanded for item in shown)
    is_tight = width < WITH_WORDS and (is_measured or is_commanded)
    compared = () if is_tight else shown[-1].references or ()
    table = Table(box=None, padding=(0, 1 if is_tight else 2, 0, 0), pad_edge=False)
    names = [f"{reference.name}\nmg" for reference in compared]
    if is_measured:
        names += ["measured\nmg", "error\n%"]
    commanded = _COMMAND if is_commanded else []
    headings = [*(each.heading for each in _FIRST), *names, *(each.heading for each in commanded)]
    for heading in (*headings, "nozzle\nflow"):
        table.add_column(Text(heading), justify="right", no_wrap=True)
    table.add_column(Text("\nvalid?"), no_wrap=True)
    for item in shown:
        report = item.report
        references = [f"{reference.mass / MILLIGRAM:.2f}" for reference in item.references or ()]
        references = (references + ["-"] * len(compared))[: len(compared)]
        table.add_row(
            *(each.text(each.of(report, c)) for each in _FIRST),
            *references,
            *(_measured(item) if is_measured else ()),
            *(each.text(each.of(report, c)) for each in commanded),
            _wear(report, not is_tight),
            _verdict(report, width >= WITH_WORDS),
        )
    return table


def _wear(report: InjectionReport, with_interval: bool) -> str:
    wear = report.indicators[NOZZLE]
    sigma = f" ±{1.96 * wear.sigma:.1%}" if with_interval and wear.sigma is not None else ""
    return f"{wear.value:+.1%}{sigma}"


def _verdict(report: InjectionReport, in_words: bool) -> Text:
    if report.valid:
        return Text("valid", style="green")
    words = f": {REASONS[report.reason].what}" if in_words else ""
    return Text(_names(report) + words, style="yellow", overflow="ellipsis")


def _names(report: InjectionReport) -> str:
    return ", ".join(reason.name for reason in report.reasons)


def _measured(shown: ShownInjection) -> tuple[str, str]:
    """Measured mass, and the error of the estimate."""
    if shown.measured is None:
        return "-", "-"
    return f"{shown.measured.mass / MILLIGRAM:.2f}", f"{100 * shown.measured.error:+.2f}"
