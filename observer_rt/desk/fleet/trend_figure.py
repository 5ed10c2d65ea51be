"""A figure of the courses of the most worn injectors."""

from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.dates import date2num
from matplotlib.figure import Figure

from observer_rt.desk.fleet.trend import QUANTITIES, Course, InjectorTrend, Limit
from observer_rt.foundation.figures import FOUND, GIVEN, LOOK, save_figure

_PANELS = {each.panel: [n for n, q in QUANTITIES.items() if q.panel == each.panel] for each in QUANTITIES.values()}
_COLOURS = {name: colour for names in _PANELS.values() for name, colour in zip(names, (FOUND, GIVEN), strict=True)}
_MOST_DRAWN = 12
_DPI = 110


def draw(path: Path, trends: Sequence[InjectorTrend], limits: Sequence[Limit]) -> None:
    """A figure of the courses of the most worn injectors: each recording, the line through them, the limits."""
    drawn = [trend for trend in trends if trend.times][:_MOST_DRAWN]
    shown = {name for trend in drawn for name in trend.courses}
    panels = [panel for panel, names in _PANELS.items() if shown.intersection(names)] or [*_PANELS][:1]
    rows = max(1, len(drawn))
    with mpl.rc_context({**LOOK, "date.converter": "concise"}):
        figure = Figure(figsize=(4.0 + 4.0 * len(panels), 2.4 * rows), layout="constrained")
        grid = figure.subplots(rows, len(panels), sharey="col", squeeze=False)
        for trend, row in zip(drawn, grid, strict=False):
            for axes, panel in zip(row, panels, strict=True):
                named = [name for name in _PANELS[panel] if name in trend.courses]
                axes.set_visible(bool(named))
                for name in named:
                    _draw_course(axes, name, trend.courses[name], trend.times[0])
                for name, size in (limit for limit in limits if limit.name in _PANELS[panel]):
                    axes.axhline(QUANTITIES[name].factor * size, color=_COLOURS[name], lw=1, ls="--")
                axes.set(title=trend.injector, ylabel=panel)
                axes.legend(axes.containers, named, loc="upper left", frameon=False)
                axes.xaxis_date()
    save_figure(figure, path, _DPI)


def _draw_course(axes: Axes, name: str, course: Course, first: datetime) -> None:
    colour, factor = _COLOURS[name], QUANTITIES[name].factor
    times, value, error = [date2num(first + timedelta(days=d)) for d in course.days], course.value, course.half
    axes.errorbar(times, factor * value, factor * error, fmt="o", ms=3, lw=0.8, color=colour, alpha=0.55)
    if course.line:
        level, half = (factor * share for share in course.line.at(course.line.days))
        axes.fill_between(times, level - half, level + half, color=colour, alpha=0.2, lw=0)
        axes.plot(times, level, color=colour, lw=2)
