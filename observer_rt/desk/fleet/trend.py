"""The wear of injectors over time, as a table, a page and a picture: the last valid estimate of recordings."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.dates import date2num
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.table import Table

from observer_rt.engine.reports.injection_report import WEAR
from observer_rt.foundation.console import plain_table
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.figures import save_figure, svg_figure
from observer_rt.foundation.files import file_errors, templates_of

Signal = NDArray[np.float64]
SURE = 1.959964  # standard deviations of a 95 % interval
_DRIFTS, _LEAST_DRIFT = 24, 1e-3  # how many are tried, and the least of them, of what the sightings span
_COLUMNS = {each.name.partition("_")[0]: each.columns for each in WEAR}  # of the value, its interval
LEAP = 0.05  # of a flow from one recording to the next: wear takes many
NEEDED = ("injector", "sha256", "time", "number", "valid", *chain.from_iterable(_COLUMNS.values()))
"""Columns of a batch's rows that a trend is made of."""
_COLOURS = {"nozzle": "#0b4f9e", "seat": "#188038"}
_SIDE_BY_SIDE = 3
_PAGES = templates_of(__package__)


@dataclass(frozen=True, eq=False)
class Course:
    """One indicator of an injector at its recordings, (n,): each by itself with its standard deviation, all smoothed.

    drift: standard deviation of its change from one recording to the next, as the recordings show it.
    """

    value: Signal
    sigma: Signal
    level: Signal
    level_sigma: Signal
    drift: float

    @property
    def band(self) -> tuple[Signal, Signal]:
        """Ends of the 95 % interval of the level."""
        return self.level - SURE * self.level_sigma, self.level + SURE * self.level_sigma


@dataclass(frozen=True, eq=False)
class InjectorTrend:
    """An injector's wear: when its recordings were made, and relative changes of flow by indicator.

    recordings: all of them, those without a valid estimate included.
    """

    injector: str
    times: tuple[datetime, ...]
    courses: dict[str, Course]
    recordings: int
    injections: int

    @property
    def wear(self) -> float:
        """The largest change of a flow that the last recordings show; 0 if none shows any."""
        return max(
            (abs(float(each.level[-1])) for each in self.courses.values() if each.level.size), default=0.0
        )


def trends(rows: pa.Table) -> list[InjectorTrend]:
    """Trends of every injector in the rows of a batch (columns `NEEDED`), the most worn first.

    Raises `UserError` for recordings of one injector at the same time, as copied files seem to be.
    """
    table = rows.to_pandas().sort_values(["time", "number"])
    for name, its in table.groupby("injector"):
        _refuse_overlapping(str(name), its)
    found = [_trend(str(name), its) for name, its in table.groupby("injector")]
    return sorted(found, key=lambda trend: (-trend.wear, trend.injector))


def _refuse_overlapping(injector: str, table: pd.DataFrame) -> None:
    spans = table.groupby("sha256")["time"].agg(["min", "max"]).sort_values("min")
    if len(spans) > 1 and (spans["min"].to_numpy()[1:] <= spans["max"].to_numpy()[:-1]).any():
        raise UserError(
            f"trend of {injector}",
            "has recordings at the same time: of CSV and Parquet it is when the file was last written, which copying "
            "changes",
            "say where their paths have it: `observer-rt batch --time-from PATTERN` into a new folder; or give each "
            "recording once",
        )


def _trend(injector: str, table: pd.DataFrame) -> InjectorTrend:
    known = table[table["valid"]].dropna(subset=[value for value, _, _ in _COLUMNS.values()])
    last = known.groupby("sha256", sort=False).tail(1)
    courses = {}
    for name, columns in _COLUMNS.items():
        value, low, high = (last[column].to_numpy(float) for column in columns)
        courses[name] = smoothed(value, 0.5 * (high - low) / SURE)
    return InjectorTrend(
        injector,
        tuple(each.to_pydatetime() for each in last["time"]),
        courses,
        int(table["sha256"].nunique()),
        len(table),
    )


def smoothed(value: Signal, sigma: Signal) -> Course:
    """A quantity that walks at random, seen with noise: what all sightings (n,) say of it at each.

    How far it walks from one to the next nobody knows: every drift counts by how likely it makes the sightings.
    """
    if value.size == 0:
        return Course(value, sigma, value, sigma, 0.0)
    scale = max(float(np.ptp(value)), float(np.median(sigma)))
    drifts = scale * np.geomspace(_LEAST_DRIFT, 1.0, _DRIFTS) if value.size > 1 else np.zeros(1)
    runs = [_smoothed(value, sigma, drift) for drift in drifts.tolist()]
    surprise = np.array([run.surprise for run in runs])
    weight = np.exp(-0.5 * (surprise - surprise.min()))
    weight /= weight.sum()
    levels, variances = np.array([run.level for run in runs]), np.array([run.variance for run in runs])
    level = weight @ levels
    variance = weight @ (variances + (levels - level) ** 2)
    return Course(value, sigma, level, np.sqrt(variance), float(weight @ drifts))


@dataclass(frozen=True, eq=False)
class _Smoothed:
    """Level and variance (n,) with one drift; surprise: minus twice the logarithm of its likelihood."""

    level: Signal
    variance: Signal
    surprise: float


def _smoothed(value: Signal, sigma: Signal, drift: float) -> _Smoothed:
    """Kalman's filter forth, the Rauch-Tung-Striebel smoother back."""
    level, variance, ahead = value.copy(), sigma**2, np.full(value.size, np.inf)
    surprise = 0.0
    for k in range(1, value.size):
        ahead[k] = variance[k - 1] + drift**2
        expected, error = ahead[k] + sigma[k] ** 2, value[k] - level[k - 1]
        surprise += error**2 / expected + math.log(expected)
        gain = ahead[k] / expected
        level[k] = level[k - 1] + gain * error
        variance[k] = (1.0 - gain) * ahead[k]
    for k in range(value.size - 2, -1, -1):
        gain = variance[k] / ahead[k + 1]
        level[k] += gain * (level[k + 1] - level[k])
        variance[k] += gain**2 * (variance[k + 1] - ahead[k + 1])
    return _Smoothed(level, variance, surprise)


def as_json(found: Sequence[InjectorTrend]) -> list[dict[str, object]]:
    """For programs: relative changes of flow at the last recordings."""
    return [
        {
            "injector": trend.injector,
            "recordings": trend.recordings,
            "injections": trend.injections,
            **{
                name: {
                    "value": float(course.level[-1]),
                    "ci95": [float(end[-1]) for end in course.band],
                    "drift_per_recording": course.drift,
                }
                for name, course in trend.courses.items()
                if course.level.size
            },
        }
        for trend in found
    ]


def table_of(found: Sequence[InjectorTrend]) -> Table:
    """For the terminal: changes of flow at the last recordings, an injector a row."""
    headings = ["injector", "recordings", "injections", "last valid"]
    headings += [heading for name in _COLUMNS for heading in (f"{name} flow, %", "change a recording, %")]
    rows = []
    for trend in found:
        when = f"{trend.times[-1]:%Y-%m-%d %H:%M}" if trend.times else "never"
        cells = [trend.injector, str(trend.recordings), str(trend.injections), when]
        for course in trend.courses.values():
            if not course.level.size:
                cells += ["-", "-"]
                continue
            half = SURE * course.level_sigma[-1]
            cells += [f"{100.0 * course.level[-1]:+.2f} ± {100.0 * half:.2f}", f"{100.0 * course.drift:.2f}"]
        rows.append(cells)
    return plain_table(headings, rows, right=(1, 2, *range(4, len(headings))))


def doubts(found: Sequence[InjectorTrend]) -> Iterator[str]:
    """Injectors whose recordings leap: they may be of several."""
    for trend in found:
        for name, course in trend.courses.items():
            if course.drift > LEAP:
                yield (
                    f"{trend.injector}: {name} flow changes by some {100.0 * course.drift:.0f} % from one "
                    "recording to the next: are they of one injector?\n"
                    "  remedy: if they are of several, name them: observer-rt batch --injector-from PATTERN, into a "
                    "new folder"
                )


def write_page(path: Path, found: Sequence[InjectorTrend], source: Path) -> None:
    """One self-contained HTML page."""
    pictures = []
    for trend in found:
        with svg_figure(9.0, 3.0, {}) as (figure, svg):
            _draw(figure.add_subplot(), trend)
            pictures.append(Markup(svg()))
    page = _PAGES.get_template("trend.html.j2").render(
        trends=list(zip(found, pictures, strict=True)), source=source, sure=SURE
    )
    with file_errors(path):
        path.write_text(page, encoding="utf-8")


def write_picture(path: Path, found: Sequence[InjectorTrend]) -> None:
    """All injectors in one picture; format by suffix."""
    columns = min(_SIDE_BY_SIDE, len(found))
    rows = -(-len(found) // columns)
    figure = Figure(figsize=(5.0 * columns, 3.2 * rows), layout="constrained")
    for number, place in enumerate(figure.subplots(rows, columns, sharey=True, squeeze=False).flat):
        if number < len(found):
            _draw(place, found[number])
            place.set_title(found[number].injector)
        else:
            place.axis("off")
    save_figure(figure, path, 130)


def _draw(axes: Axes, trend: InjectorTrend) -> None:
    times = date2num(trend.times)
    axes.xaxis_date()
    for name, course in trend.courses.items():
        if not course.level.size:
            continue
        low, high = course.band
        axes.fill_between(times, 100.0 * low, 100.0 * high, color=_COLOURS[name], alpha=0.2, lw=0)
        axes.plot(times, 100.0 * course.level, color=_COLOURS[name], lw=2, label=name)
        points: dict[str, Any] = {"fmt": "o", "ms": 3, "lw": 0.8, "color": _COLOURS[name], "alpha": 0.55}
        axes.errorbar(times, 100.0 * course.value, 100.0 * SURE * course.sigma, **points)
    axes.axhline(0.0, color="0.6", lw=0.8)
    axes.set_ylabel("change of flow, %")
    axes.tick_params(axis="x", labelrotation=20)
    if trend.times:
        axes.legend(loc="best", frameon=False)
    else:
        axes.text(0.5, 0.5, "no valid injection", transform=axes.transAxes, ha="center")
