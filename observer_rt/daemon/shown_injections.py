"""Injections on the terminal: the recent ones as a table, one as curves of rate and line pressure."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import plotext
from numpy.typing import NDArray
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from observer_rt.daemon.snapshot import ShownInjection
from observer_rt.engine.reports.injection_report import NAMED
from observer_rt.foundation.units import Z_95

Values = Mapping[str, Any]
LOWEST = 6  # lines of a plot
STACKED = 20  # lines, from which there is room for two plots
_BAND, _ESTIMATE, _MEASURED = "gray", "green+", "cyan"
_REFERENCES = ("orange", "magenta")
_STYLES = {"gray": "dim", "green+": "bright_green", "cyan": "cyan", "orange": "yellow", "magenta": "magenta"}

WITH_WORDS = 110  # columns, from which all columns have room, and reasons are put into words
HEADING = 2  # lines
_FIRST = [NAMED[name] for name in ("number", "rail_pressure_MPa", "mass_mg", "mass_bound_mg")]
_COMMAND = [NAMED["command"], NAMED["opening_delay_us"]]


class _CurveLine(NamedTuple):
    name: str
    colour: str  # as plotext calls it
    values: NDArray[np.float32]


def curves(shown: ShownInjection, size: tuple[int, int]) -> RenderableType:
    """Plots in so many columns and lines."""
    width, height = size
    if height >= STACKED:
        upper = round(0.6 * height)
        return Group(_rate(shown, (width, upper)), _pressure(shown, (width, height - upper)))
    return _rate(shown, size)


def _rate(shown: ShownInjection, size: tuple[int, int]) -> RenderableType:
    corrected, half = shown.curve("corrected_rate_mm3_per_ms"), Z_95 * shown.curve("corrected_rate_sigma_mm3_per_ms")
    lines = [_CurveLine("95 %", _BAND, corrected - half), _CurveLine("", _BAND, corrected + half)]
    for name, colour in zip(shown.references, _REFERENCES, strict=False):
        lines.append(_CurveLine(name, colour, shown.curve(f"{name}_rate_mm3_per_ms")))
    lines.append(_CurveLine("live", _MEASURED, shown.curve("rate_mm3_per_ms")))
    lines.append(_CurveLine("corrected", _ESTIMATE, corrected))
    lines = [each for each in lines if not np.isnan(each.values).all()]
    values = shown.values
    title = f"injection {values['number']} at {values['rail_pressure_MPa']:.0f} MPa, mm3/ms:"
    return _plot(title, shown.curve("time_ms"), lines, size)


def _pressure(shown: ShownInjection, size: tuple[int, int]) -> RenderableType:
    model, measured = shown.curve("modelled_pressure_MPa"), shown.curve("line_pressure_MPa")
    furthest = float(np.max(np.abs(model - measured), initial=0.0))
    lines = [_CurveLine("observer", _ESTIMATE, model), _CurveLine("sensor", _MEASURED, measured)]
    title = f"line pressure, MPa over ms, {furthest:.1f} MPa apart:"
    return _plot(title, shown.curve("time_ms"), lines, size)


def _plot(
    title: str, time: NDArray[np.float32], lines: Sequence[_CurveLine], size: tuple[int, int]
) -> RenderableType:
    """Lines below a heading that names them in their colours; later ones cover earlier ones."""
    plotext.clear_figure()
    plotext.limit_size(False, False)
    plotext.plotsize(size[0], size[1] - 1)
    plotext.theme("clear")
    heading = Text(f" {title}", no_wrap=True, overflow="ellipsis")
    for line in lines:
        available = ~np.isnan(line.values)
        values = line.values[available].tolist()
        plotext.plot(time[available].tolist(), values, marker="braille", color=line.colour)
        if line.name:
            heading.append(f"  {line.name}", _STYLES[line.colour])
    return Group(heading, Text.from_ansi(str(plotext.build()).rstrip("\n")))


def injections(shown: Sequence[ShownInjection], width: int) -> Table:
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
    headings = [*(each.heading for each in _FIRST), *names, *(each.heading for each in commanded)]
    for heading in (*headings, "nozzle\nflow"):
        table.add_column(Text(heading), justify="right", no_wrap=True)
    table.add_column(Text("\nvalid?"), no_wrap=True)
    for item in shown:
        values, masses = item.values, (item.references.get(name) for name in compared)
        table.add_row(
            *(each.text(values[each.name]) for each in _FIRST),
            *("-" if mass is None else f"{mass:.2f}" for mass in masses),
            *(_measured(values) if is_measured else ()),
            *(each.text(values[each.name]) for each in commanded),
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
    """Measured mass, and the error of the estimate."""
    mass = values["measured_mass_mg"]
    if mass is None:
        return "-", "-"
    estimate = math.nan if values["mass_mg"] is None else values["mass_mg"]
    return f"{mass:.2f}", f"{100 * (estimate / mass - 1.0):+.2f}"
