"""Wear and needle of injectors over dates: lines through last valid estimates, and when they reach limits."""

import math
import re
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
import pandas as pd
import pyarrow as pa
from rich.table import Table
from scipy.optimize import brentq
from scipy.stats import t as student

from observer_rt.desk.fleet.recordings import TIME_FROM, PathPattern, TimeFrom
from observer_rt.engine.reports.injection_report import INDICATORS, WEAR, IndicatorFields
from observer_rt.foundation.console import plain_table
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MICROSECOND, Floats

FEWEST = 4  # recordings that a line is made of
_SIGMAS, _LEAST_SIGMA = 1.959964, 0.01  # standard deviations of a recording's 95 % interval; of its value, % or us
_STEPS = 1001  # days at which a limit is looked for; odd: the last recording's is one
_LIMIT = re.compile(r"(?P<name>\w+)=(?P<size>[+-]?\d*\.?\d+)\s*(?P<unit>%|us)?")
_DAY, _MONTH = 86400.0, 30.4375  # s; days
_LIMIT_REMEDY = "write it like nozzle=30%, seat=-20% or closes_later=100us"
_TIME_REMEDY = f"say where their paths have the time: {TIME_FROM} PATTERN, such as '_(\\d{{8}}_\\d{{6}})'"


class TrendQuantity(NamedTuple):
    """An indicator that has a trend."""

    panel: str  # of a figure
    columns: tuple[str, ...]  # value, and the ends of its interval
    unit: str = "%"  # on the screen

    @property
    def factor(self) -> float:
        """Numbers on the screen over those in the columns."""
        return 100.0 if self.unit == "%" else 1.0 / MICROSECOND


def _needle(indicator: IndicatorFields) -> TrendQuantity:
    is_delay = indicator.unit == "s"
    unit = "us" if is_delay else "%"
    return TrendQuantity(f"needle {'later' if is_delay else 'faster'}, {unit}", indicator.columns, unit)


_FLOWS = {each.name.partition("_")[0]: TrendQuantity("change of flow, %", each.columns) for each in WEAR}
_MOVES = ("needle_opens_", "needle_closes_")
_NEEDLE = {i.name.removeprefix("needle_"): _needle(i) for i in INDICATORS if i.name.startswith(_MOVES)}
QUANTITIES = _FLOWS | _NEEDLE
"""By name; those of the needle where no lift is recorded."""
NEEDED = (
    *("injector", "file", "sha256", "time", "time_from", "number", "valid"),
    *chain.from_iterable(each.columns for each in QUANTITIES.values()),
)
"""Columns of a batch's rows that a trend is made of."""


class Limit(NamedTuple):
    """Change that must not be reached: a positive one from below, a negative one from above."""

    name: str
    size: float  # as a share, or in s

    @classmethod
    def read(cls, text: str) -> Self:
        """A limit of the command line, such as `nozzle=30%`. Raises `UserError` for another text."""
        match = _LIMIT.fullmatch(text.strip())
        quantity, size = match and QUANTITIES.get(match["name"]), float(match["size"]) if match else 0.0
        if not match or not quantity or (match["unit"] or "%") != quantity.unit or size == 0.0:
            raise UserError(f"--limit {text}", f"is no limit of {' or '.join(QUANTITIES)}", _LIMIT_REMEDY)
        return cls(match["name"], size / quantity.factor if match["unit"] else size)

    def __str__(self) -> str:
        quantity = QUANTITIES[self.name]
        return f"{self.name} {quantity.factor * self.size:+g} {quantity.unit}"


class WearLine(NamedTuple):
    """A change by days since the first recording."""

    days: Floats  # (n,)
    coefficients: Floats  # (2,) change a day, and on day 0
    spread: Floats  # (2, 2) their covariance, times the squared 95 % quantile

    @classmethod
    def of(cls, days: Floats, value: Floats, half: Floats, factor: float = 100.0) -> Self:
        """Through values with 95 % intervals of these halves, all (n,), n >= `FEWEST`, at rising days.

        Scatter beyond intervals adds to the variance of each, to make chi squared its degrees of freedom (Paule and
        Mandel, 1982). factor: to % or us.
        """
        variance, freedom = np.maximum(half / _SIGMAS, _LEAST_SIGMA / factor) ** 2, days.size - 2

        def fit(scatter: float) -> tuple[Floats, Floats, float]:
            weight = 1.0 / np.sqrt(variance + scatter)
            line, covariance = np.polyfit(days, value, 1, w=weight, cov="unscaled")
            return line, covariance, float(np.sum((weight * (value - np.polyval(line, days))) ** 2)) - freedom

        most = float(np.ptp(value)) ** 2
        scatter = brentq(lambda trial: fit(trial)[2], 0.0, most, xtol=1e-9 * most) if fit(0.0)[2] > 0.0 else 0.0
        line, covariance, _ = fit(scatter)
        return cls(days, line, covariance * student.ppf(0.975, freedom) ** 2)

    def at(self, days: Floats) -> tuple[Floats, Floats]:
        """Levels and halves of their 95 % intervals, as days (k,)."""
        design = np.vander(days, 2)
        return design @ self.coefficients, np.sqrt(((design @ self.spread) * design).sum(axis=1))

    def reaches(self, limit: Limit) -> tuple[float, float, float]:
        """Day on which the level reaches a limit, between the ends of its 95 % interval.

        No forecast reaches farther ahead than the recordings reach back: infinite, except for the low end.
        """
        side, last = math.copysign(1.0, limit.size), self.days[-1]
        is_reached = side * (self.at(self.days)[0][-1] - limit.size) >= 0.0
        days = last * np.linspace(0.0 if is_reached else 1.0, 2.0, _STEPS)
        level, half = self.at(days)
        beyond = [side * (level - limit.size) + sign * half >= 0.0 for sign in (1.0, 0.0, -1.0)]
        low, middle, high = (float(days[past.argmax()]) if past.any() else math.inf for past in beyond)
        return min(low, float(days[-1])), middle, high


class Course(NamedTuple):
    """A change at recordings, and halves of its 95 % intervals, (n,); line: None of fewer than `FEWEST`."""

    days: Floats  # (n,) since the first recording with a valid estimate
    value: Floats
    half: Floats
    line: WearLine | None

    @property
    def now(self) -> tuple[float, float]:
        """At the last recording, and half of its 95 % interval: by the line, or without one by that recording."""
        level, half = self.line.at(self.line.days) if self.line else (self.value, self.half)
        return float(level[-1]), float(half[-1])

    @property
    def rate(self) -> tuple[float, float] | None:
        """A month, and half of its 95 % interval."""
        line = self.line
        return (_MONTH * float(line.coefficients[0]), _MONTH * math.sqrt(line.spread[0, 0])) if line else None


class InjectorTrend(NamedTuple):
    injector: str
    recordings: int  # all of them
    injections: int
    times: tuple[datetime, ...]  # of the recordings with a valid estimate
    courses: dict[str, Course]  # by quantity; empty without a valid estimate

    @property
    def wear(self) -> float:
        """The largest change of a flow now."""
        return max((abs(course.now[0]) for name, course in self.courses.items() if name in _FLOWS), default=0.0)


def trends(rows: pa.Table, dates: PathPattern | None = None) -> list[InjectorTrend]:
    """Trends of every injector in the rows of a batch (columns `NEEDED`), the most worn first; dates: in the paths.

    Raises `UserError` for recordings of an injector at an unknown time, or the same one, as copies seem to be.
    """
    table = rows.to_pandas()
    if dates is not None:
        begin = table["file"].map({file: dates.date_in(Path(file)) for file in table["file"].unique()})
        table = table.assign(time=begin + (table["time"] - table.groupby("sha256")["time"].transform("min")))
    elif len(doubtful := table[table["time_from"] == TimeFrom.WRITTEN]["file"].drop_duplicates()):
        raise UserError(
            "trend",
            f"{len(doubtful)} recordings, such as {doubtful.iloc[0]}, do not state when they were made; when files "
            "were last written is no answer, as copying changes it",
            _TIME_REMEDY,
        )
    table = table.sort_values(["time", "number"])
    return sorted([_trend(str(name), its) for name, its in table.groupby("injector")], key=lambda trend: -trend.wear)


def _trend(injector: str, table: pd.DataFrame) -> InjectorTrend:
    spans = table.groupby("sha256")["time"].agg(["min", "max"]).sort_values("min")
    if (spans["min"].to_numpy()[1:] <= spans["max"].to_numpy()[:-1]).any():
        remedy = f"{_TIME_REMEDY}; or give each recording once, into a new folder"
        raise UserError(f"trend of {injector}", "has recordings at the same time", remedy)
    valid = table[table["valid"]].dropna(subset=list(chain.from_iterable(each.columns for each in _FLOWS.values())))
    last = valid.groupby("sha256", sort=False).tail(1)
    days = (last["time"] - last["time"].min()).dt.total_seconds().to_numpy(float) / _DAY
    courses: dict[str, Course] = {}
    for name, quantity in QUANTITIES.items():
        numbers = last[list(quantity.columns)].to_numpy(float)
        is_known = ~np.isnan(numbers).any(axis=1)
        if is_known.any():
            value, low, high = numbers[is_known].T
            at, half = days[is_known], 0.5 * (high - low)
            line = WearLine.of(at, value, half, quantity.factor) if at.size >= FEWEST else None
            courses[name] = Course(at, value, half, line)
    times = tuple(time.to_pydatetime().astimezone(UTC) for time in last["time"])
    return InjectorTrend(injector, len(spans), len(table), times, courses)


def as_json(trends: Sequence[InjectorTrend], limits: Sequence[Limit]) -> list[dict[str, Any]]:
    """Changes at the last recordings, as shares or in s, their rates, dates of limits (null: unknown)."""
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
    days, first = course.line.reaches(limit), trend.times[0]
    low, date, high = ((first + timedelta(days=d)).isoformat() if math.isfinite(d) else None for d in days)
    return {"reached": days[1] <= float(course.line.days[-1]), "date": date, "ci95": [low, high]}


def table_of(trends: Sequence[InjectorTrend], limits: Sequence[Limit]) -> Table:
    """A row of each injector: its flows, and limits."""
    changes = [text for name in _FLOWS for text in (f"{name}, %", "a month, %")]
    headings = ["injector", "recordings", *changes, "last valid", *map(str, limits)]
    return plain_table(headings, [list(_cells(trend, limits)) for trend in trends], right=range(1, 2 + len(changes)))


def needle_table_of(trends: Sequence[InjectorTrend]) -> Table | None:
    """A row of each number of a needle; None where every lift was recorded."""
    rows = [
        [trend.injector, f"{name}, {quantity.unit}", *_changes(quantity, trend.courses.get(name))]
        for trend in trends
        for name, quantity in _NEEDLE.items()
        if name in trend.courses
    ]
    return plain_table(["injector", "needle", "now", "a month"], rows, right=(2, 3)) if rows else None


def _changes(quantity: TrendQuantity, course: Course | None) -> Iterator[str]:
    """Now, and a month."""
    for size in (course and course.now, course and course.rate):
        yield f"{quantity.factor * size[0]:+.2f} ± {quantity.factor * size[1]:.2f}" if size else "-"


def _cells(trend: InjectorTrend, limits: Sequence[Limit]) -> Iterator[str]:
    yield from (trend.injector, str(trend.recordings))
    for name, quantity in _FLOWS.items():
        yield from _changes(quantity, trend.courses.get(name))
    yield f"{trend.times[-1]:%Y-%m-%d}" if trend.times else "never"
    for limit in limits:
        said = _date_json(trend, limit)
        if not said:
            yield f"needs {FEWEST} recordings" if limit.name in {*_FLOWS, *trend.courses} else "-"
            continue
        low, date, high = (moment and moment[:10] for moment in (said["ci95"][0], said["date"], said["ci95"][1]))
        about = f"{'reached ' * said['reached']}{date} ({low} to {high or 'later'})"
        yield about if date else f"not before {low}"
