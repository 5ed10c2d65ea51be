"""Draws laws of nozzle and seat as the network learned them: a curve over each input, with its 95 % interval."""

from collections.abc import Sequence

from matplotlib.gridspec import SubplotSpec

from observer_rt.engine.estimation.scalars import NOZZLE, SEAT
from observer_rt.engine.learning.learned_curves import LearnedCurve
from observer_rt.foundation.figures import svg_figure

FLOWS = {NOZZLE: ("nozzle", "#d62728"), SEAT: ("seat", "#9467bd")}  # name and colour
HEIGHT, COLUMNS = 4.6, 3  # inches, of all curves, and of these side by side
LEAST_RANGE = 2.0  # %, that is drawn at least: smaller changes look as small as they are
_PERCENT = 100.0


def draw_learned(part: SubplotSpec, curves: Sequence[LearnedCurve]) -> None:
    """Draw the curves of both flows in part of a figure, all on one scale."""
    panels = part.subgridspec(-(-len(curves) // COLUMNS), COLUMNS).subplots(sharey=True, squeeze=False)
    for axes, curve in zip(panels.flat, curves, strict=False):
        change, half = _PERCENT * curve.change, _PERCENT * curve.half_width
        flow, colour = FLOWS[curve.flow]
        axes.axhline(0, color="#222222", lw=0.8)
        axes.fill_between(curve.inputs, change - half, change + half, color=colour, alpha=0.18, lw=0)
        axes.plot(curve.inputs, change, color=colour, lw=1.4)
        variable, _, unit = curve.variable.rpartition("_")
        axes.set_xlabel(f"{variable.replace('_', ' ')} [{unit}], {flow}", fontsize=8)
        axes.grid(alpha=0.3)
    for axes in panels[:, 0]:
        axes.set_ylabel("learned change\nof the flow [%]")
    for axes in panels.flat[len(curves) :]:
        axes.remove()
    values = [_PERCENT * value for curve in curves for value in (*curve.change, 0.0)]
    margin = max(0.15 * (max(values) - min(values)), LEAST_RANGE)
    panels[0, 0].set_ylim(min(values) - margin, max(values) + margin)


def learned_figure(curves: Sequence[LearnedCurve]) -> str:
    """The same as SVG."""
    with svg_figure(10.4, HEIGHT) as (figure, svg):
        draw_learned(figure.add_gridspec(1, 1)[0], curves)
    return svg()
