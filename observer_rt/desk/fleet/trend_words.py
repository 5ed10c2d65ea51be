"""Trends in words and numbers: the table of the terminal, cells of the page, JSON."""

import math
from collections.abc import Callable, Sequence

from rich.table import Table

from observer_rt.desk.fleet.course import SURE, Course
from observer_rt.desk.fleet.forecast import FEWEST, QUANTITIES, Crossing
from observer_rt.desk.fleet.trend import MONTH, InjectorTrend, Outlook
from observer_rt.foundation.console import plain_table

PER_AGE = 1000.0  # hours, or whatever the column counts
UNKNOWN = "-"


def table_of(found: Sequence[InjectorTrend]) -> Table:
    """For the terminal: changes of flow at the last recordings, their rates, dates of limits; an injector a row."""
    names, rows = headings(found), cells(found)
    limits = len(found[0].outlooks) if found else 0
    first = ("injector", "recordings", "last valid")
    numbers = range(len(first), len(first) + len(names) - limits * (2 if has_age(found) else 1))
    lines = (
        (
            trend.injector,
            str(trend.recordings),
            f"{trend.times[-1]:%Y-%m-%d}" if trend.times else "never",
            *row,
        )
        for trend, row in zip(found, rows, strict=True)
    )
    return plain_table([*first, *names], lines, right=(1, *numbers))


def has_age(found: Sequence[InjectorTrend]) -> bool:
    """Whether of any injector the age is known."""
    return any(trend.by_age for trend in found)


def headings(found: Sequence[InjectorTrend]) -> list[str]:
    """What stands above `cells`."""
    rates = ["a month, %", *([f"in {PER_AGE:g} of age, %"] if has_age(found) else [])]
    said = [text for name in QUANTITIES for text in (f"{name}, %", *rates)]
    for outlook in found[0].outlooks if found else ():
        said += [str(outlook.limit), *([f"{outlook.limit}, age"] if has_age(found) else [])]
    return said


def cells(found: Sequence[InjectorTrend]) -> list[list[str]]:
    """By injector: changes of flow with their 95 % intervals, their rates, when limits are reached."""
    with_age = has_age(found)
    return [list(_cells(trend, with_age)) for trend in found]


def _cells(trend: InjectorTrend, with_age: bool) -> list[str]:
    said = []
    for name, course in trend.courses.items():
        known = course.level.size > 0
        said.append(_percent(float(course.level[-1]), float(course.level_sigma[-1])) if known else UNKNOWN)
        said.append(_rate(course, MONTH))
        if with_age:
            said.append(_rate(trend.by_age.get(name), PER_AGE))
    for outlook in trend.outlooks:
        said.append(_when(outlook.by_day, lambda day: f"{trend.date(day):%Y-%m-%d}"))
        if with_age:
            said.append(_when(outlook.by_age, lambda age: f"{trend.ages[0] + age:.0f}"))
    return said


def _percent(value: float, sigma: float) -> str:
    return f"{100.0 * value:+.2f} ± {100.0 * SURE * sigma:.2f}"


def _rate(course: Course | None, over: float) -> str:
    if course is None or course.level.size < 2:
        return UNKNOWN
    return _percent(over * course.slope, over * course.slope_sigma)


def _when(crossing: Crossing | None, text: Callable[[float], str]) -> str:
    if crossing is None:
        return f"asks {FEWEST} recordings"
    if crossing.reached is not None:
        return f"reached {text(crossing.reached)}"
    if crossing.not_before is not None:
        return f"not before {text(crossing.not_before)}"
    high = text(crossing.high) if math.isfinite(crossing.high) else "later"
    return f"{text(crossing.middle)} ({text(crossing.low)} to {high})"


def as_json(found: Sequence[InjectorTrend]) -> list[dict[str, object]]:
    """For programs: relative changes of flow at the last recordings, their rates, when limits are reached."""
    return [
        {
            "injector": trend.injector,
            "recordings": trend.recordings,
            "injections": trend.injections,
            **{
                name: _course_json(trend, name) for name, course in trend.courses.items() if course.level.size
            },
            "limits": [_outlook_json(trend, outlook) for outlook in trend.outlooks],
        }
        for trend in found
    ]


def _course_json(trend: InjectorTrend, name: str) -> dict[str, object]:
    course = trend.courses[name]
    rates = {"rate_per_month": (course, MONTH)} if course.level.size > 1 else {}
    if rates and trend.by_age:
        rates["rate_per_1000_of_age"] = trend.by_age[name], PER_AGE
    return {
        "value": float(course.level[-1]),
        "ci95": [float(end[-1]) for end in course.band],
        **{
            key: {
                "value": over * its.slope,
                "ci95": [over * (its.slope + side * SURE * its.slope_sigma) for side in (-1.0, 1.0)],
            }
            for key, (its, over) in rates.items()
        },
    }


def _outlook_json(trend: InjectorTrend, outlook: Outlook) -> dict[str, object]:
    return {
        "limit": str(outlook.limit),
        "date": _crossing_json(outlook.by_day, lambda day: trend.date(day).isoformat()),
        "age": _crossing_json(outlook.by_age, lambda age: float(trend.ages[0] + age)),
    }


def _crossing_json(crossing: Crossing | None, said: Callable[[float], object]) -> dict[str, object] | None:
    """None: of too few recordings, or without an age."""
    if crossing is None:
        return None
    if crossing.reached is not None:
        return {"reached": said(crossing.reached)}
    if crossing.not_before is not None:
        return {"not_before": said(crossing.not_before)}
    high = said(crossing.high) if math.isfinite(crossing.high) else None
    return {"value": said(crossing.middle), "ci95": [said(crossing.low), high]}
