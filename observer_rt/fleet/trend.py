"""The wear of injectors over time: of every recording the last valid estimate, and what they say together."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import chain

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from observer_rt.service.reports.injection_record import WEAR

Signal = NDArray[np.float64]
SURE = 1.959964  # standard deviations of a 95 % interval
_DRIFTS, _LEAST_DRIFT = 24, 1e-3  # how many are tried, and the least of them, of what the sightings span
_COLUMNS = {each.name.partition("_")[0]: each.columns for each in WEAR}  # of the value, its interval
NEEDED = (
    "injector",
    "sha256",
    "time",
    "number",
    "valid",
    *chain.from_iterable(_COLUMNS.values()),
)
"""Columns of a batch's rows that a trend is made of."""


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
    """Of every injector in the rows of a batch (columns `NEEDED`), the most worn first."""
    found = [
        _trend(name, rows.filter(pa.compute.equal(rows["injector"], name)))
        for name in pa.compute.unique(rows["injector"]).to_pylist()
    ]
    return sorted(found, key=lambda trend: (-trend.wear, trend.injector))


def _trend(injector: str, rows: pa.Table) -> InjectorTrend:
    table = rows.to_pandas().sort_values(["time", "number"])
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
                    "ci95": [
                        float(course.level[-1] - SURE * course.level_sigma[-1]),
                        float(course.level[-1] + SURE * course.level_sigma[-1]),
                    ],
                    "drift_per_recording": course.drift,
                }
                for name, course in trend.courses.items()
                if course.level.size
            },
        }
        for trend in found
    ]
