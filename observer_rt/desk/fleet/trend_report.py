"""Trends for people and programs: JSON, and out of it the table of the terminal."""

import math
from collections.abc import Iterator, Sequence
from datetime import timedelta
from typing import Any

from rich.table import Table

from observer_rt.desk.fleet.trend import FEWEST, QUANTITIES, InjectorTrend, Limit
from observer_rt.foundation.console import plain_table


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
    changes = [text for name in QUANTITIES for text in (f"{name}, %", "a month, %")]
    headings = ["injector", "recordings", *changes, "last valid", *map(str, limits)]
    rows = [list(_cells(said)) for said in as_json(trends, limits)]
    return plain_table(headings, rows, right=range(1, 2 + len(changes)))


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
