"""A figure of the courses of the most worn injectors."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.dates import date2num
from matplotlib.figure import Figure

from observer_rt.desk.fleet.trend import QUANTITIES, InjectorTrend, Limit
from observer_rt.foundation.figures import FOUND, GIVEN, LOOK, save_figure

_COLOURS = dict(zip(QUANTITIES, (FOUND, GIVEN), strict=True))
_MOST_DRAWN = 12
_DPI = 110


def draw(path: Path, trends: Sequence[InjectorTrend], limits: Sequence[Limit]) -> None:
    """A figure of the courses of the most worn injectors: each recording, the line through them, the limits."""
    drawn = [trend for trend in trends if trend.times][:_MOST_DRAWN]
    with mpl.rc_context(LOOK):
        figure = Figure(figsize=(8.0, 2.4 * max(1, len(drawn))), layout="constrained")
        every = figure.subplots(max(1, len(drawn)), sharey=True, squeeze=False)[:, 0]
        for axes, trend in zip(every, drawn, strict=False):
            times = date2num(trend.times)
            for name, course in trend.courses.items():
                colour, value, error = _COLOURS[name], 100.0 * course.value, 100.0 * course.half
                axes.errorbar(times, value, error, fmt="o", ms=3, lw=0.8, color=colour, alpha=0.55, label=name)
                if course.line:
                    level, half = (100.0 * share for share in course.line.at(course.line.days))
                    axes.fill_between(times, level - half, level + half, color=colour, alpha=0.2, lw=0)
                    axes.plot(times, level, color=colour, lw=2)
            axes.xaxis_date()
            axes.set(title=trend.injector, ylabel="change of flow, %")
            axes.legend(loc="upper left", frameon=False)
            for limit in limits:
                axes.axhline(100.0 * limit.size, color=_COLOURS[limit.name], lw=1, ls="--")
    save_figure(figure, path, _DPI)
