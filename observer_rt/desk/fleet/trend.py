"""The wear of injectors over dates: the last valid estimate of each recording, and what all of them say together."""

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path

import pandas as pd
import pyarrow as pa

from observer_rt.desk.fleet.recordings import TIME_FROM, PathPattern, TimeFrom
from observer_rt.desk.fleet.wear import FEWEST, QUANTITIES, Signal, WearLine
from observer_rt.engine.reports.injection_report import WEAR
from observer_rt.foundation.errors import UserError

_COLUMNS = {
    name: indicator.columns for name, indicator in zip(QUANTITIES, WEAR, strict=True)
}  # value, interval
NEEDED = (
    *("injector", "file", "sha256", "time", "time_from", "number", "valid"),
    *chain.from_iterable(_COLUMNS.values()),
)
"""Columns of a batch's rows that a trend is made of."""
_DAY, _MONTH = 86400.0, 30.4375  # s; days
_HOW = f"say where their paths have the time: {TIME_FROM} PATTERN, such as '_(\\d{{8}}_\\d{{6}})'"


@dataclass(frozen=True, eq=False)
class Course:
    """A change of flow at recordings, and halves of its 95 % intervals, (n,); line: None of fewer than `FEWEST`."""

    value: Signal
    half: Signal
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


@dataclass(frozen=True, eq=False)
class InjectorTrend:
    """An injector's wear by indicator, at the recordings with a valid estimate, whose times are given.

    courses: empty without such a recording; recordings: all of them.
    """

    injector: str
    recordings: int
    injections: int
    times: tuple[datetime, ...]
    courses: dict[str, Course]


def trends(
    rows: pa.Table, dates: PathPattern | None = None, trusts_file_times: bool = False
) -> list[InjectorTrend]:
    """Trends of every injector in the rows of a batch (columns `NEEDED`), the most worn first.

    dates: in the files' paths; trusts_file_times: files were written as they were recorded. Raises `UserError` for
    recordings of one injector at the same time, as copied files seem to be, or at an unknown one.
    """
    table = rows.to_pandas()
    if dates is not None:
        begin = table["file"].map({file: dates.date_in(Path(file)) for file in table["file"].unique()})
        since = table["time"] - table.groupby("sha256")["time"].transform("min")
        table = table.assign(time=begin + since)
    elif not trusts_file_times:
        _refuse_written(table)
    table = table.sort_values(["time", "number"])
    made = [_trend(str(name), its) for name, its in table.groupby("injector")]
    return sorted(
        made, key=lambda trend: min((-abs(each.now[0]) for each in trend.courses.values()), default=0.0)
    )


def _refuse_written(table: pd.DataFrame) -> None:
    doubtful = table[table["time_from"] == TimeFrom.WRITTEN]["file"].drop_duplicates()
    if len(doubtful):
        raise UserError(
            "trend",
            f"{len(doubtful)} recordings, such as {doubtful.iloc[0]}, do not state when they were made; when files "
            "were last written is no answer, as copying changes it",
            f"{_HOW}; or --trust-file-times, if they were written as they were recorded",
        )


def _trend(injector: str, table: pd.DataFrame) -> InjectorTrend:
    spans = table.groupby("sha256")["time"].agg(["min", "max"]).sort_values("min")
    if (spans["min"].to_numpy()[1:] <= spans["max"].to_numpy()[:-1]).any():
        remedy = f"{_HOW}; or give each recording once, into a new folder"
        raise UserError(f"trend of {injector}", "has recordings at the same time", remedy)
    valid = table[table["valid"]].dropna(subset=list(chain.from_iterable(_COLUMNS.values())))
    last = valid.groupby("sha256", sort=False).tail(1)
    days = (last["time"] - last["time"].min()).dt.total_seconds().to_numpy(float) / _DAY
    courses: dict[str, Course] = {}
    for name in _COLUMNS if len(last) else ():
        value, low, high = (last[column].to_numpy(float) for column in _COLUMNS[name])
        half = 0.5 * (high - low)
        line = WearLine.of(days, value, half) if len(last) >= FEWEST else None
        courses[name] = Course(value, half, line)
    times = tuple(time.to_pydatetime().astimezone(UTC) for time in last["time"])
    return InjectorTrend(injector, len(spans), len(table), times, courses)
