"""Trends for people and programs: JSON, and out of it the table of the terminal and of the page."""

import math
from collections.abc import Iterator, Sequence
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.dates import date2num
from rich.table import Table

from observer_rt.desk.fleet.trend import FEWEST, QUANTITIES, InjectorTrend, Limit
from observer_rt.foundation.console import plain_table
from observer_rt.foundation.figures import FOUND, GIVEN, svg_figure
from observer_rt.foundation.files import templates_of
from observer_rt.foundation.outputs import write_text

_COLOURS = dict(zip(QUANTITIES, (FOUND, GIVEN), strict=True))
_MOST_DRAWN = 24
_PAGES = templates_of(__package__)


def as_json(trends: Sequence[InjectorTrend], limits: Sequence[Limit]) -> list[dict[str, Any]]:
    """Relative changes of flow at the last recordings, their rates, dates of limits (null: unknown)."""
    return [
        {
            "injector": trend.injector,
            "recordings": trend.recordings,
            "injections": trend.injections,
            "last_valid": trend.times[-1].isoformat() if trend.times else None,
            **{
                name: {**_size_json(course.now), "rate_per_month": course.rate and _size_json(course.rate)}
                for name, course in trend.courses.items()
            },
            "limits": [{"limit": str(limit), **_date_json(trend, limit)} for limit in limits],
        }
        for trend in trends
    ]


def _size_json(size: tuple[float, float]) -> dict[str, Any]:
    return {"value": size[0], "ci95": [size[0] - size[1], size[0] + size[1]]}


def _date_json(trend: InjectorTrend, limit: Limit) -> dict[str, Any]:
    course = trend.courses.get(limit.name)
    if course is None or course.line is None:
        return {}
    days = course.line.reaches(limit)
    low, date, high = (
        (trend.times[0] + timedelta(days=day)).isoformat() if math.isfinite(day) else None for day in days
    )
    return {"reached": days[1] <= float(course.line.days[-1]), "date": date, "ci95": [low, high]}


def table_of(trends: Sequence[InjectorTrend], limits: Sequence[Limit]) -> Table:
    """For the terminal: an injector a row."""
    numbers = range(1, 2 + 2 * len(QUANTITIES))
    return plain_table(_headings(limits), _rows(trends, limits), right=numbers)


def _headings(limits: Sequence[Limit]) -> list[str]:
    changes = [text for name in QUANTITIES for text in (f"{name}, %", "a month, %")]
    return ["injector", "recordings", *changes, "last valid", *map(str, limits)]


def _rows(trends: Sequence[InjectorTrend], limits: Sequence[Limit]) -> list[list[str]]:
    return [list(_cells(said)) for said in as_json(trends, limits)]


def _cells(said: dict[str, Any]) -> Iterator[str]:
    yield from (said["injector"], str(said["recordings"]))
    for now in map(said.get, QUANTITIES):
        for size in (now, now and now["rate_per_month"]):
            half = 100.0 * (size["ci95"][1] - size["value"]) if size else 0.0
            yield f"{100.0 * size['value']:+.2f} ± {half:.2f}" if size else "-"
    yield (said["last_valid"] or "never")[:10]
    for limit in said["limits"]:
        if "date" not in limit:
            yield f"needs {FEWEST} recordings"
            continue
        low, date, high = (each and each[:10] for each in (limit["ci95"][0], limit["date"], limit["ci95"][1]))
        about = f"{'reached ' * limit['reached']}{date} ({low} to {high or 'later'})"
        yield about if date else f"not before {low}"


def write_page(path: Path, trends: Sequence[InjectorTrend], limits: Sequence[Limit], source: Path) -> None:
    """One self-contained HTML page: the table of all injectors, the courses of the most worn ones."""
    drawn = [trend for trend in trends if trend.times][:_MOST_DRAWN]
    changes = [float(np.abs(course.value).max()) for trend in drawn for course in trend.courses.values()]
    scale = 110.0 * max(0.05, *changes, *(abs(limit.size) for limit in limits))  # %, of all pictures
    page = _PAGES.get_template("trend.html.j2").render(
        headings=_headings(limits),
        rows=_rows(trends, limits),
        drawn=[(trend.injector, _picture(trend, limits, scale)) for trend in drawn],
        source=source,
    )
    write_text(path, page)


def _picture(trend: InjectorTrend, limits: Sequence[Limit], scale: float) -> Markup:
    with svg_figure(8.0, 2.6) as (figure, svg):
        axes = figure.subplots()
        times = date2num(trend.times)
        for name, course in trend.courses.items():
            colour, value, error = _COLOURS[name], 100.0 * course.value, 100.0 * course.half
            axes.errorbar(times, value, error, fmt="o", ms=3, lw=0.8, color=colour, alpha=0.55, label=name)
            if course.line:
                level, half = (100.0 * each for each in course.line.at(course.line.days))
                axes.fill_between(times, level - half, level + half, color=colour, alpha=0.2, lw=0)
                axes.plot(times, level, color=colour, lw=2)
        for limit in limits:
            axes.axhline(100.0 * limit.size, color=_COLOURS[limit.name], lw=1, ls="--")
        axes.xaxis_date()
        axes.set(ylabel="change of flow, %", ylim=(-scale, scale))
        axes.legend(loc="upper left", frameon=False)
        return Markup(svg())  # made here, of numbers and escaped words
