"""When a course reaches a limit: ways that it may go on, as it has gone so far, and when each of them is there."""

import math
import re
from dataclasses import dataclass
from functools import cache
from typing import Self

import numpy as np

from observer_rt.desk.fleet.course import Course, Signal
from observer_rt.engine.reports.injection_report import WEAR
from observer_rt.foundation.errors import UserError

FEWEST = 4  # sightings that a forecast is made of
QUANTITIES = tuple(each.name.partition("_")[0] for each in WEAR)
_WAYS, _STEPS = 1000, 64
_LIMIT = re.compile(r"(?P<name>\w+)=(?P<size>[+-]?\d*\.?\d+)(?P<percent>\s*%)?")


@dataclass(frozen=True)
class Limit:
    """Relative change of a flow that must not be reached: a positive one from below, a negative from above."""

    name: str
    size: float

    @classmethod
    def read(cls, text: str) -> Self:
        """A limit of the command line, such as `nozzle=30%`. Raises `UserError` for what is none."""
        found = _LIMIT.fullmatch(text.strip())
        size = float(found["size"]) / (100.0 if found["percent"] else 1.0) if found else 0.0
        if not found or found["name"] not in QUANTITIES or size == 0.0:
            example = "write it like nozzle=30% or seat=-20%"
            raise UserError(f"--limit {text}", f"is no limit of {' or '.join(QUANTITIES)}", example)
        return cls(found["name"], size)

    def __str__(self) -> str:
        return f"{self.name} {100.0 * self.size:+g} %"


@dataclass(frozen=True)
class Crossing:
    """Where a course reaches a limit, on the course's own axis. reached: where it has been, None: not yet.

    low, middle, high: ends of the 95 % interval and median; infinite beyond `horizon`, as far after the last sighting
    as the first one is before it: nothing is said of what lies there.
    """

    low: float
    middle: float
    high: float
    horizon: float
    reached: float | None = None

    @property
    def not_before(self) -> float | None:
        """Where it is not yet reached, if it is not known where it is."""
        return min(self.low, self.horizon) if math.isinf(self.middle) else None


def crossing(course: Course, limit: Limit) -> Crossing | None:
    """Where a course reaches a limit; None of too few sightings."""
    if course.end is None or course.level.size < FEWEST or not np.ptp(course.place):
        return None
    side, last = math.copysign(1.0, limit.size), float(course.place[-1])
    reach = last - float(course.place[0])
    horizon = last + reach
    beyond = side * (course.level - limit.size) >= 0.0
    if beyond[-1]:
        first = int(np.flatnonzero(~beyond)[-1]) + 1 if not beyond.all() else 0
        place = float(course.place[first])
        return Crossing(place, place, place, horizon, place)
    over = side * (_ways(course) - limit.size) >= 0.0
    step = np.where(over.any(axis=1), over.argmax(axis=1), np.inf)
    low, middle, high = np.quantile(step, (0.025, 0.5, 0.975), method="higher").tolist()
    low, middle, high = (last + reach * max(0.0, each - 0.5) / _STEPS for each in (low, middle, high))
    return Crossing(low, middle, high, horizon)


def _ways(course: Course) -> Signal:
    """Ways that the level may go on from the last sighting, (_WAYS, _STEPS + 1), as far ahead as there are any."""
    end = course.end
    assert end is not None
    start, wander, bend = _chance()
    pair = np.searchsorted(np.cumsum(end.weight), (np.arange(_WAYS) + 0.5) / _WAYS).clip(
        max=end.weight.size - 1
    )
    roots = np.linalg.cholesky(end.covariance + 1e-15 * np.eye(2))
    state = end.state[pair] + np.einsum("wij,wj->wi", roots[pair], start)
    time = np.linspace(0.0, 1.0, _STEPS + 1)
    ways = state[:, :1] + state[:, 1:] * time
    ways += end.level_wanders[pair, None] * wander + end.slope_wanders[pair, None] * bend
    found: Signal = course.value[0] + end.scale * ways
    return found


@cache
def _chance() -> tuple[Signal, Signal, Signal]:
    """Chance, the same for all: starts (_WAYS, 2), a walk and the integral of one, (_WAYS, _STEPS + 1)."""
    random, step = np.random.default_rng(0), 1.0 / _STEPS
    start = random.standard_normal((_WAYS, 2))
    walks = random.standard_normal((2, _WAYS, _STEPS)).cumsum(axis=2) * math.sqrt(step)
    wander, slope = np.concatenate((np.zeros((2, _WAYS, 1)), walks), axis=2)
    bend = np.concatenate(
        (np.zeros((_WAYS, 1)), (0.5 * step * (slope[:, 1:] + slope[:, :-1])).cumsum(axis=1)), axis=1
    )
    return start, wander, bend
