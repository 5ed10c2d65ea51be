"""Trends for people and programs: the table of the terminal, the page, JSON."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from markupsafe import Markup
from matplotlib.dates import date2num
from rich.table import Table

from observer_rt.desk.fleet.trend import InjectorTrend
from observer_rt.desk.fleet.wear import FEWEST, QUANTITIES, SURE, Course, Crossing, Limit
from observer_rt.foundation.console import plain_table
from observer_rt.foundation.figures import FOUND, GIVEN, svg_figure
from observer_rt.foundation.files import templates_of
from observer_rt.foundation.outputs import write_text

_COLOURS = dict(zip(QUANTITIES, (FOUND, GIVEN), strict=True))
_MOST_DRAWN = 24
_MONTH = 30.4375  # days
_PAGES = templates_of(__package__)


def table_of(trends: Sequence[InjectorTrend], limits: Sequence[Limit]) -> Table:
    """For the terminal: changes of flow at the last recordings, their rates, dates of limits; an injector a row."""
    numbers = range(1, 2 + 2 * len(QUANTITIES))
    return plain_table(_headings(limits), [list(_cells(trend)) for trend in trends], right=numbers)


def _headings(limits: Sequence[Limit]) -> list[str]:
    changes = [text for name in QUANTITIES for text in (f"{name}, %", "a month, %")]
    return ["injector", "recordings", *changes, "last valid", *map(str, limits)]


def _cells(trend: InjectorTrend) -> Iterator[str]:
    yield trend.injector
    yield str(trend.recordings)
    for name in QUANTITIES:
        sizes = _sizes(trend.courses[name]) if trend.courses else (None, None)
        yield from (
            "-" if size is None else f"{100.0 * size[0]:+.2f} ± {100.0 * SURE * size[1]:.2f}"
            for size in sizes
        )
    yield f"{trend.times[-1]:%Y-%m-%d}" if trend.times else "never"
    for crossing in trend.crossings:
        yield f"needs {FEWEST} recordings" if crossing is None else _when(trend, crossing)


def _sizes(course: Course) -> tuple[tuple[float, float], tuple[float, float] | None]:
    """The change at the last recording, and its rate a month, None of recordings at one time; standard deviations."""
    rate = (_MONTH * course.rate, _MONTH * course.rate_sigma) if np.ptp(course.days) else None
    return (float(course.level[-1]), float(course.level_sigma[-1])), rate


def _when(trend: InjectorTrend, crossing: Crossing) -> str:
    low, middle, high = (
        f"{trend.date(day):%Y-%m-%d}" if math.isfinite(day) else None
        for day in (crossing.low, crossing.middle, crossing.high)
    )
    if crossing.is_reached:
        return f"reached {middle}"
    return f"{middle} ({low} to {high or 'later'})" if middle else f"not before {low}"


def as_json(trends: Sequence[InjectorTrend], limits: Sequence[Limit]) -> list[dict[str, object]]:
    """For programs: relative changes of flow at the last recordings, their rates, dates of limits (null: unknown)."""
    return [
        {
            "injector": trend.injector,
            "recordings": trend.recordings,
            "injections": trend.injections,
            **{name: _course_json(course) for name, course in trend.courses.items()},
            "limits": [
                {"limit": str(limit), **(_crossing_json(trend, crossing) if crossing else {})}
                for limit, crossing in zip(limits, trend.crossings, strict=True)
            ],
        }
        for trend in trends
    ]


def _course_json(course: Course) -> dict[str, object]:
    now, rate = (
        size and {"value": size[0], "ci95": [size[0] + side * SURE * size[1] for side in (-1.0, 1.0)]}
        for size in _sizes(course)
    )
    return {**(now or {}), "rate_per_month": rate}


def _crossing_json(trend: InjectorTrend, crossing: Crossing) -> dict[str, object]:
    low, middle, high = (
        trend.date(day).isoformat() if math.isfinite(day) else None
        for day in (crossing.low, crossing.middle, crossing.high)
    )
    return {"reached": crossing.is_reached, "date": middle, "ci95": [low, high]}


def write_page(path: Path, trends: Sequence[InjectorTrend], limits: Sequence[Limit], source: Path) -> None:
    """One self-contained HTML page: the table of all injectors, the courses of the most worn ones."""
    drawn = [trend for trend in trends if trend.times][:_MOST_DRAWN]
    scale = _scale(drawn, limits)
    page = _PAGES.get_template("trend.html.j2").render(
        headings=_headings(limits),
        rows=[list(_cells(trend)) for trend in trends],
        drawn=[(trend.injector, _picture(trend, limits, scale)) for trend in drawn],
        source=source,
    )
    write_text(path, page)


def _scale(trends: Sequence[InjectorTrend], limits: Sequence[Limit]) -> float:
    """Change of flow [%] at the ends of the one scale of all pictures."""
    changes = [float(np.abs(course.level).max()) for trend in trends for course in trend.courses.values()]
    return 110.0 * max(0.05, *changes, *(abs(limit.size) for limit in limits))


def _picture(trend: InjectorTrend, limits: Sequence[Limit], scale: float) -> Markup:
    with svg_figure(8.0, 2.6) as (figure, svg):
        axes = figure.subplots()
        times = date2num(trend.times)
        for name, course in trend.courses.items():
            colour, level, half = _COLOURS[name], 100.0 * course.level, 100.0 * SURE * course.level_sigma
            axes.fill_between(times, level - half, level + half, color=colour, alpha=0.2, lw=0)
            axes.plot(times, level, color=colour, lw=2, label=name)
            value, error = 100.0 * course.value, 100.0 * SURE * course.sigma
            axes.errorbar(times, value, error, fmt="o", ms=3, lw=0.8, color=colour, alpha=0.55)
        for limit in limits:
            axes.axhline(100.0 * limit.size, color=_COLOURS[limit.name], lw=1, ls="--")
        axes.xaxis_date()
        axes.set(ylabel="change of flow, %", ylim=(-scale, scale))
        axes.legend(loc="upper left", frameon=False)
        return Markup(svg())  # made here, of numbers and escaped words
