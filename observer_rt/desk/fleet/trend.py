"""The wear of injectors over time: the last valid estimates of recordings, smoothed, and when limits are reached."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from itertools import chain
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from observer_rt.desk.fleet.course import SURE, Course, Signal, smoothed
from observer_rt.desk.fleet.forecast import Crossing, Limit, crossing
from observer_rt.desk.fleet.groups import RecordingTimes
from observer_rt.desk.fleet.moment import WRITTEN
from observer_rt.engine.reports.injection_report import WEAR
from observer_rt.foundation.errors import UserError

_COLUMNS = {each.name.partition("_")[0]: each.columns for each in WEAR}  # of the value, its interval
LEAP = 0.05  # of a flow from one recording to the next: wear takes many
NEEDED = (
    *("injector", "file", "sha256", "time", "time_from", "age", "number", "valid"),
    *chain.from_iterable(_COLUMNS.values()),
)
"""Columns of a batch's rows that a trend is made of."""
DAY = 86400.0  # s
MONTH = 30.4375  # days
_DATES = (
    r"(\d{8}[_T-]?\d{6})",
    r"(\d{8}[_T-]?\d{4})",
    r"(\d{4}-\d\d-\d\d[_T-]\d\d[-_.]?\d\d[-_.]?\d\d)",
    r"(\d{4}-\d\d-\d\d)",
    r"(\d{8})",
)


@dataclass(frozen=True, eq=False)
class Outlook:
    """A limit, and where courses reach it: by days since the first recording, and by age where that is known."""

    limit: Limit
    by_day: Crossing | None
    by_age: Crossing | None


@dataclass(frozen=True, eq=False)
class InjectorTrend:
    """An injector's wear: relative changes of flow by indicator, at the recordings with a valid estimate, (n,).

    times, files: of these; ages: such as operating hours, empty where not all have one; by_age: courses over them.
    recordings: all of them, those without a valid estimate included.
    """

    injector: str
    times: tuple[datetime, ...]
    files: tuple[str, ...]
    ages: Signal
    courses: dict[str, Course]
    by_age: dict[str, Course]
    outlooks: tuple[Outlook, ...]
    recordings: int
    injections: int

    @property
    def wear(self) -> float:
        """The largest change of a flow that the last recordings show; 0 if none shows any."""
        return max(
            (abs(float(each.level[-1])) for each in self.courses.values() if each.level.size), default=0.0
        )

    def date(self, day: float) -> datetime:
        """Date of a place in the courses."""
        return self.times[0] + timedelta(days=day)


def trends(
    rows: pa.Table, limits: Sequence[Limit] = (), time_from: str | None = None, trust_written: bool = False
) -> list[InjectorTrend]:
    """Trends of every injector in the rows of a batch (columns `NEEDED`), the most worn first.

    time_from: as of `RecordingTimes`, of the files' paths; trust_written: files were written as they were recorded.
    Raises `UserError` for recordings of one injector at the same time, as copied files seem to be, or at an unknown
    one.
    """
    table = rows.to_pandas()
    if time_from is not None:
        table = _dated(table, RecordingTimes(time_from))
    elif not trust_written:
        _refuse_written(table)
    table = table.sort_values(["time", "number"])
    for name, its in table.groupby("injector"):
        _refuse_overlapping(str(name), its)
    found = [_trend(str(name), its, limits) for name, its in table.groupby("injector")]
    return sorted(found, key=lambda trend: (-trend.wear, trend.injector))


def _dated(table: pd.DataFrame, times: RecordingTimes) -> pd.DataFrame:
    """The rows with the times that their paths say, of each recording its first injection."""
    said = table["file"].map({file: times.of(Path(file)) for file in table["file"].unique()})
    since = table["time"] - table.groupby("sha256")["time"].transform("min")
    return table.assign(time=said + since)


def _refuse_written(table: pd.DataFrame) -> None:
    doubtful = table[table["time_from"] == WRITTEN]["file"].drop_duplicates()
    if len(doubtful):
        raise UserError(
            "trend",
            f"{len(doubtful)} recordings, such as {doubtful.iloc[0]}, do not state when they were made; when files "
            "were last written is no answer, as copying changes it",
            f"say where their paths have it: {_time_from(doubtful)}; or --trust-file-times, if they were written as "
            "they were recorded",
        )


def _time_from(files: "pd.Series[str]") -> str:
    """The option that finds a date in all paths, as far as can be guessed."""
    fits = (each for each in _DATES if all(re.search(each, file) for file in files))
    return f"--time-from '{next(fits, RecordingTimes.EXAMPLE)}'"


def _refuse_overlapping(injector: str, table: pd.DataFrame) -> None:
    spans = table.groupby("sha256")["time"].agg(["min", "max"]).sort_values("min")
    if len(spans) > 1 and (spans["min"].to_numpy()[1:] <= spans["max"].to_numpy()[:-1]).any():
        raise UserError(
            f"trend of {injector}",
            "has recordings at the same time",
            f"say where their paths have the time: {_time_from(table['file'])}; or give each recording once, into "
            "a new folder",
        )


def _trend(injector: str, table: pd.DataFrame, limits: Sequence[Limit]) -> InjectorTrend:
    known = table[table["valid"]].dropna(subset=list(chain.from_iterable(_COLUMNS.values())))
    last = known.groupby("sha256", sort=False).tail(1)
    days = (last["time"] - last["time"].min()).dt.total_seconds().to_numpy(float) / DAY
    ages = last["age"].to_numpy(float)
    if not np.isfinite(ages).all():
        ages = ages[:0]
    if (np.diff(ages) < 0.0).any():
        place = int(np.argmax(np.diff(ages) < 0.0))
        raise UserError(
            f"trend of {injector}",
            f"falls in age from {ages[place]:g} to {ages[place + 1]:g} at {last['file'].iloc[place + 1]}",
            "name another column, batch --age-from, or the injector by it if it was replaced",
        )
    courses = {name: _course(last, days, name) for name in _COLUMNS}
    by_age = {name: _course(last, ages - ages[0], name) for name in _COLUMNS} if ages.size else {}
    return InjectorTrend(
        injector,
        tuple(each.to_pydatetime().astimezone(UTC) for each in last["time"]),
        tuple(last["file"]),
        ages,
        courses,
        by_age,
        tuple(
            Outlook(
                each,
                crossing(courses[each.name], each),
                crossing(by_age[each.name], each) if by_age else None,
            )
            for each in limits
        ),
        int(table["sha256"].nunique()),
        len(table),
    )


def _course(last: pd.DataFrame, place: Signal, name: str) -> Course:
    value, low, high = (last[column].to_numpy(float) for column in _COLUMNS[name])
    return smoothed(place, value, 0.5 * (high - low) / SURE)


def doubts(found: Sequence[InjectorTrend]) -> Iterator[str]:
    """Injectors whose recordings leap: they may be of several."""
    for trend in found:
        for name, course in trend.courses.items():
            if course.leap > LEAP:
                yield (
                    f"{trend.injector}: {name} flow changes by some {100.0 * course.leap:.0f} % from one "
                    "recording to the next: are they of one injector?\n"
                    "  remedy: if they are of several, name them: observer-rt batch --injector-from PATTERN, into a "
                    "new folder"
                )
