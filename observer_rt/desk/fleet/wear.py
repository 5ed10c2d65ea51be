"""Wear of an injector over days: a weighted straight line, and the day on which it reaches a limit."""

import math
import re
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import t as student

from observer_rt.engine.reports.injection_report import WEAR
from observer_rt.foundation.errors import UserError

Signal = NDArray[np.float64]
FEWEST = 4  # recordings that a line is made of
QUANTITIES = tuple(indicator.name.partition("_")[0] for indicator in WEAR)
_SURE, _LEAST_SIGMA = 1.959964, 1e-4  # standard deviations of a recording's 95 % interval; of its value
_STEPS = 1001  # days at which a limit is looked for; odd: the last recording's is one
_LIMIT = re.compile(r"(?P<name>\w+)=(?P<size>[+-]?\d*\.?\d+)(?P<percent>\s*%)?")


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
            problem = f"is no limit of {' or '.join(QUANTITIES)}"
            raise UserError(f"--limit {text}", problem, "write it like nozzle=30% or seat=-20%")
        return cls(match["name"], size)

    def __str__(self) -> str:
        return f"{self.name} {100.0 * self.size:+g} %"


@dataclass(frozen=True, eq=False)
class WearLine:
    """Change of flow by days (n,) since the first recording.

    coefficients, (2,): a day, and on day 0; spread, (2, 2): their covariance, times squared 95 % quantile.
    """

    days: Signal
    coefficients: Signal
    spread: Signal

    @classmethod
    def of(cls, days: Signal, value: Signal, half: Signal) -> Self:
        """Through values with 95 % intervals of these halves, all (n,), n >= `FEWEST`, at rising days.

        What values scatter beyond their intervals is added to the variance of each, so that chi squared is its
        degrees of freedom (Paule and Mandel, 1982).
        """
        variance, freedom = np.maximum(half / _SURE, _LEAST_SIGMA) ** 2, days.size - 2

        def fit(scatter: float) -> tuple[Signal, Signal, float]:
            weight = 1.0 / np.sqrt(variance + scatter)
            line, covariance = np.polyfit(days, value, 1, w=weight, cov="unscaled")
            return line, covariance, float(np.sum((weight * (value - np.polyval(line, days))) ** 2)) - freedom

        scattered = fit(0.0)[2] > 0.0
        scatter = brentq(lambda each: fit(each)[2], 0.0, np.ptp(value) ** 2) if scattered else 0.0
        line, covariance, _ = fit(scatter)
        return cls(days, line, covariance * student.ppf(0.975, freedom) ** 2)

    def at(self, days: Signal) -> tuple[Signal, Signal]:
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
        low, middle, high = (float(days[each.argmax()]) if each.any() else math.inf for each in beyond)
        return min(low, float(days[-1])), middle, high
