"""Draws laws of nozzle and seat as the network learned them: curves with 95 % intervals, surfaces."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.gridspec import SubplotSpec

from observer_rt.engine.estimation.parameters import NOZZLE, SEAT
from observer_rt.engine.reports.learned_laws import LearnedLaw
from observer_rt.foundation.figures import svg_figure

FLOWS = {NOZZLE: ("nozzle", "#d62728"), SEAT: ("seat", "#9467bd")}  # name and colour
ROW, COLUMNS = 2.3, 3  # inches, of a row of curves, and curves side by side
LEAST_RANGE = 2.0  # %, that is drawn at least: smaller changes look as small as they are
_PERCENT = 100.0


def draw_learned(part: SubplotSpec, laws: Sequence[LearnedLaw]) -> None:
    """Draw the curves of both flows in part of a figure, all on one scale, and after them the surfaces."""
    panels = part.subgridspec(_rows(laws), COLUMNS).subplots(squeeze=False)
    curves = [law for law in laws if not law.is_surface]
    values = [_PERCENT * value for curve in curves for value in (*curve.change, 0.0)]
    margin = max(0.15 * (max(values) - min(values)), LEAST_RANGE)
    for axes, curve in zip(panels.flat, curves, strict=False):
        change, half = _PERCENT * curve.change, _PERCENT * curve.half_width
        flow, colour = FLOWS[curve.flow]
        axes.axhline(0, color="#222222", lw=0.8)
        axes.fill_between(*curve.inputs, change - half, change + half, color=colour, alpha=0.18, lw=0)
        axes.plot(*curve.inputs, change, color=colour, lw=1.4)
        axes.set_xlabel(f"{_label(*curve.variables)}, {flow}", fontsize=8)
        axes.set_ylim(min(values) - margin, max(values) + margin)
        axes.grid(alpha=0.3)
    for axes in panels.flat[: len(curves) : COLUMNS]:
        axes.set_ylabel("learned change\nof the flow [%]")
    for axes, surface in zip(panels.flat[len(curves) :], laws[len(curves) :], strict=False):
        _draw_surface(axes, surface)
    for axes in panels.flat[len(laws) :]:
        axes.remove()


def _draw_surface(axes: Axes, surface: LearnedLaw) -> None:
    """Surface in colours, hatched where no event was."""
    change, seen = _PERCENT * surface.change.T, surface.is_seen.T
    most = max(np.abs(change[seen]).max(initial=0.0), LEAST_RANGE)
    mesh = axes.pcolormesh(*surface.inputs, change, cmap="RdBu_r", vmin=-most, vmax=most, rasterized=True)
    if not seen.all():
        axes.contourf(*surface.inputs, ~seen, levels=[0.5, 1.5], colors="none", hatches=["////"])
    half = _PERCENT * np.median(surface.half_width.T[seen]) if seen.any() else np.nan
    axes.figure.colorbar(mesh, ax=axes, label=f"{FLOWS[surface.flow][0]} flow [%], ± {half:.1f}")
    axes.set_xlabel(_label(surface.variables[0]), fontsize=8)
    axes.set_ylabel(_label(surface.variables[1]), fontsize=8)


def _label(variable: str) -> str:
    name, _, unit = variable.rpartition("_")
    return f"{name.replace('_', ' ')} [{unit}]"


def height_of(laws: Sequence[LearnedLaw]) -> float:
    """Inches that laws take."""
    return ROW * _rows(laws)


def _rows(laws: Sequence[LearnedLaw]) -> int:
    return -(-len(laws) // COLUMNS)


def learned_figure(laws: Sequence[LearnedLaw]) -> str:
    with svg_figure(10.4, height_of(laws)) as (figure, svg):
        draw_learned(figure.add_gridspec(1, 1)[0], laws)
    return svg()
