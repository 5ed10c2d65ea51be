"""Wear of an injector over days: a straight line that wanders, and the day on which it reaches a limit.

The change of flow is y(t) = a + b t + l W(t) + s integral of V, with Wiener processes W and V. Nobody knows how much
level (l) and rate (s) wander: each pair of a grid counts by how likely it makes the recordings.
"""

import math
import re
from dataclasses import dataclass
from itertools import product
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.special import ndtr

from observer_rt.engine.reports.injection_report import WEAR
from observer_rt.foundation.errors import UserError

Signal = NDArray[np.float64]
SURE = 1.959964  # standard deviations of a 95 % interval
FEWEST = 4  # recordings that a date is made of
QUANTITIES = tuple(indicator.name.partition("_")[0] for indicator in WEAR)
_LEVEL_WANDERS, _RATE_WANDERS = np.geomspace(0.03, 1.0, 6), np.geomspace(0.003, 2.0, 5)
"""l and s that are tried, in parts of what the recordings span, over their time; so are the next."""
_PRIOR_LEVEL, _PRIOR_RATE, _LEAST_SIGMA = 10.0, 3.0, 1e-4  # standard deviations
_LEAST_SPAN = 1e-6
_STEPS = 64  # ahead
_LIMIT = re.compile(r"(?P<name>\w+)=(?P<size>[+-]?\d*\.?\d+)(?P<percent>\s*%)?")
# Of the chance that the level is beyond the limit. That it has been there is at most twice as likely (reflection
# principle): half of 2.5 % at the early end makes the interval no narrower than it says.
_EARLY, _MIDDLE, _LATE = 0.0125, 0.5, 0.975


@dataclass(frozen=True)
class Limit:
    """Relative change of a flow that must not be reached: a positive one from below, a negative one from above."""

    name: str
    size: float

    @classmethod
    def read(cls, text: str) -> Self:
        """A limit of the command line, such as `nozzle=30%`. Raises `UserError` for another text."""
        match = _LIMIT.fullmatch(text.strip())
        size = float(match["size"]) / (100.0 if match["percent"] else 1.0) if match else 0.0
        if not match or match["name"] not in QUANTITIES or size == 0.0:
            example = "write it like nozzle=30% or seat=-20%"
            raise UserError(f"--limit {text}", f"is no limit of {' or '.join(QUANTITIES)}", example)
        return cls(match["name"], size)

    def __str__(self) -> str:
        return f"{self.name} {100.0 * self.size:+g} %"


@dataclass(frozen=True)
class Crossing:
    """Days at which a limit is reached: 95 % interval and median; is_reached: it was, on that day.

    Nothing is said of what is farther ahead than the recordings reach back: middle and high are infinite there, and
    low is the day before which the limit is not reached.
    """

    low: float
    middle: float
    high: float
    is_reached: bool = False


@dataclass(frozen=True, eq=False)
class Course:
    """A change of flow at the n recordings: each by itself, and the level that all of them say together, (n,).

    days: since the first recording; rate: at the last one, a day; weight, (g,), of the pairs of the grid, by each of
    which the future has a mean and a standard deviation, (g, _STEPS + 1).
    """

    days: Signal
    value: Signal
    sigma: Signal
    level: Signal
    level_sigma: Signal
    rate: float
    rate_sigma: float
    weight: Signal
    future: Signal
    future_sigma: Signal

    def crossing(self, limit: Limit) -> Crossing | None:
        """When the level reaches a limit; None of too few recordings, or of all at one time."""
        reach, last = float(np.ptp(self.days)), float(self.days[-1])
        if self.days.size < FEWEST or not reach:
            return None
        side = math.copysign(1.0, limit.size)
        beyond = side * (self.level - limit.size) >= 0.0
        if beyond[-1]:
            before = np.flatnonzero(~beyond)
            day = float(self.days[before[-1] + 1 if before.size else 0])
            return Crossing(day, day, day, is_reached=True)
        chance = self.weight @ ndtr(side * (self.future - limit.size) / self.future_sigma)
        steps = [np.flatnonzero(chance >= share) for share in (_EARLY, _MIDDLE, _LATE)]
        low, middle, high = (
            last + reach * max(0.0, step[0] - 0.5) / _STEPS if step.size else math.inf for step in steps
        )
        return Crossing(min(low, last + reach), middle, high)


def course_of(days: Signal, value: Signal, sigma: Signal) -> Course:
    """What all recordings (n,), at least one, at rising days say together. sigma: standard deviations of the values.

    Takes time by the cube of n.
    """
    reach = float(np.ptp(days)) or 1.0
    scale = max(float(np.ptp(value)), float(np.median(sigma)), _LEAST_SPAN)
    place = (days - days[0]) / reach
    prior, by_level, by_rate = _covariances(
        np.append(place, place[-1] + np.linspace(0.0, 1.0, _STEPS + 1)), place[-1]
    )
    noise = np.diag(np.maximum(sigma / scale, _LEAST_SIGMA) ** 2)
    scaled, n = (value - value[0]) / scale, days.size
    likelihood, means, variances = [], [], []
    for level_wander, rate_wander in product(_LEVEL_WANDERS, _RATE_WANDERS):
        covariance = prior + level_wander**2 * by_level + rate_wander**2 * by_rate
        root = cholesky(covariance[:n, :n] + noise, lower=True)
        white = solve_triangular(root, np.column_stack([covariance[:n], scaled]), lower=True)
        likelihood.append(-0.5 * white[:, -1] @ white[:, -1] - np.log(np.diag(root)).sum())
        means.append(white[:, :-1].T @ white[:, -1])
        variances.append(np.diag(covariance) - (white[:, :-1] ** 2).sum(axis=0))
    weight = np.exp(np.array(likelihood) - max(likelihood))
    weight /= weight.sum()
    mean, variances_of = np.array(means), np.maximum(variances, _LEAST_SIGMA**2)
    middle = weight @ mean
    spread = np.sqrt(weight @ (variances_of + (mean - middle) ** 2))
    known, ahead = slice(0, n), slice(n, -1)
    return Course(
        days,
        value,
        sigma,
        value[0] + scale * middle[known],
        scale * spread[known],
        float(middle[-1] * scale / reach),
        float(spread[-1] * scale / reach),
        weight,
        value[0] + scale * mean[:, ahead],
        scale * np.sqrt(variances_of[:, ahead]),
    )


def _covariances(place: Signal, now: float) -> tuple[Signal, Signal, Signal]:
    """Of the levels at places (n,) and the rate now, (n + 1, n + 1): of the line, and with a wander of 1 each."""
    least, most = np.minimum.outer(place, place), np.maximum.outer(place, place)
    line, by_level, by_rate = np.zeros((3, place.size + 1, place.size + 1))
    slope = np.append(place, 1.0)
    line[:] = _PRIOR_RATE**2 * np.multiply.outer(slope, slope)
    line[:-1, :-1] += _PRIOR_LEVEL**2
    by_level[:-1, :-1] = least
    by_rate[:-1, :-1] = least**2 * (3.0 * most - least) / 6.0
    earlier = np.minimum(place, now)
    by_rate[:-1, -1] = by_rate[-1, :-1] = earlier * (place - 0.5 * earlier)
    by_rate[-1, -1] = now
    return line, by_level, by_rate
