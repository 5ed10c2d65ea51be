"""Picture of the laws of nozzle and seat as they were learned."""

from collections.abc import Sequence

from matplotlib.gridspec import SubplotSpec

from observer_rt.engine.estimation.scalars import NOZZLE
from observer_rt.engine.learning.learned_curves import LearnedCurve

COLUMNS = 3  # of curves side by side
NOZZLE_STYLE, SEAT_STYLE = ("nozzle", "#d62728"), ("seat", "#9467bd")
PERCENT = 100.0
LEAST_RANGE = 2.0  # %, that is drawn at least: smaller changes look as small as they are


def draw_learned(part: SubplotSpec, curves: Sequence[LearnedCurve]) -> None:
    """Draw in part of a figure the curves of both flows, each with its 95 % interval, all on one scale."""
    rows = -(-len(curves) // COLUMNS)
    panels = part.subgridspec(rows, COLUMNS).subplots(sharey=True, squeeze=False)
    for axes, curve in zip(panels.flat, curves, strict=False):
        change, half = PERCENT * curve.change, PERCENT * curve.half_width
        flow, colour = NOZZLE_STYLE if curve.flow == NOZZLE else SEAT_STYLE
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
    values = [PERCENT * value for curve in curves for value in (*curve.change, 0.0)]
    margin = max(0.15 * (max(values) - min(values)), LEAST_RANGE)
    panels[0, 0].set_ylim(min(values) - margin, max(values) + margin)
