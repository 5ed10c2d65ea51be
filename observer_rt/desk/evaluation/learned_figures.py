"""Picture of the laws of nozzle and seat as they were learned."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec

from observer_rt.engine.estimation.scalars import NOZZLE
from observer_rt.engine.learning.learned_curves import LearnedCurve

COLUMNS = 3  # of curves side by side
COLOURS = {NOZZLE: "#d62728"}
SEAT_COLOUR = "#9467bd"
PERCENT = 100.0
LEAST_RANGE = 2.0  # %, that is drawn at least: smaller changes look as small as they are
_NAMES = {
    "pressure_drop_MPa": "pressure drop [MPa]",
    "seat_area_mm2": "seat area [mm2]",
    "time_since_opening_ms": "time since the opening [ms]",
    "rail_pressure_MPa": "rail pressure [MPa]",
}


def draw_learned(figure: Figure, part: SubplotSpec, curves: Sequence[LearnedCurve]) -> None:
    """Draw in part of a figure the curves of both flows, each with its 95 % interval, all on one scale."""
    rows = -(-len(curves) // COLUMNS)
    grid = part.subgridspec(rows, COLUMNS)
    drawn: list[Axes] = []
    for number, curve in enumerate(curves):
        axes = figure.add_subplot(
            grid[number // COLUMNS, number % COLUMNS], sharey=drawn[0] if drawn else None
        )
        change, half = PERCENT * curve.change, PERCENT * curve.half_width
        colour = COLOURS.get(curve.flow, SEAT_COLOUR)
        axes.axhline(0, color="#222222", lw=0.8)
        axes.fill_between(curve.inputs, change - half, change + half, color=colour, alpha=0.18, lw=0)
        axes.plot(curve.inputs, change, color=colour, lw=1.4)
        flow = "nozzle" if curve.flow == NOZZLE else "seat"
        axes.set_xlabel(f"{_NAMES[curve.variable]}, {flow}", fontsize=8)
        if number % COLUMNS == 0:
            axes.set_ylabel("learned change\nof the flow [%]")
        axes.grid(alpha=0.3)
        drawn.append(axes)
    values = [PERCENT * value for curve in curves for value in (*curve.change, 0.0)]
    margin = max(0.15 * (max(values) - min(values)), LEAST_RANGE)
    drawn[0].set_ylim(min(values) - margin, max(values) + margin)
