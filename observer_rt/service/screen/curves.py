"""Curves of one injection as text: its rate with its band, its line pressure beside the model's."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import plotext
from numpy.typing import NDArray
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND, MM3_PER_MS
from observer_rt.model.coefficients import Coefficients
from observer_rt.service.screen.shown import ShownInjection

LOWEST = 6  # lines of a plot
SIDE_BY_SIDE = 130  # columns
STACKED = 20  # lines, from which there is room for two plots
_BAND, _ESTIMATE, _MEASURED = "gray", "green+", "cyan"
_REFERENCES = ("orange", "magenta")
_STYLES = {"gray": "dim", "green+": "bright_green", "cyan": "cyan", "orange": "yellow", "magenta": "magenta"}


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
