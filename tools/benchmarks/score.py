"""A case's score, event by event and in figures."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.units import MM3_PER_MS
from tests.plants.arrays import Array
from tests.plants.plant import Truth
from tests.plants.windows import Windows
from tools.benchmarks.campaign import Task

FROM = 4  # from 0: everything but the figures of the first events counts from the fifth event on
SCORED = slice(FROM, None)
WRONG_MASS = 3.0  # %, beyond which a valid injection is wrong
WRONG_RATE = 3.0  # mm3/ms
OBSERVER, NOMINAL = "observer", "nominal"
UKF, EKF = "joint UKF", "joint EKF"
Z_95 = 1.96  # sigmas


@dataclass(frozen=True)
class EstimatorScore:
    """What an estimator made of a recording, event by event."""

    name: str
    mass_mg: tuple[float, ...]
    opening_mass_mg: tuple[float, ...]
    """Of every opening, an event's one after the other."""
    rate_square_error: tuple[float, ...]
    """Mean over the union of the event's windows [(mm3/ms)^2]."""
    x3_square_error: tuple[float, ...] = ()
    """The same of the normalised sac pressure; empty for an estimator without one."""


@dataclass(frozen=True)
class Injection:
    """What the observer reports as one injection: an opening, or several that it cannot tell apart."""

    event: int
    openings: tuple[int, ...]
    valid: bool


@dataclass(frozen=True)
class SampleTime:
    """What a sample costs the observer [us], best of several blocks: needle open, and long shut."""

    open_us: float
    closed_us: float


@dataclass(frozen=True)
class CaseScore(Task):
    """One case scored; tuples are per event."""

    change_event: int | None
    nozzle_wear: float
    varying: bool
    """Whether the operating point changes from event to event."""
    true_mass_mg: tuple[float, ...]
    true_opening_mass_mg: tuple[float, ...]
    injections: tuple[Injection, ...]
    window_samples: tuple[int, ...]
    estimators: tuple[EstimatorScore, ...]
    valid: tuple[bool, ...]
    reasons: tuple[str, ...]
    mass_ci95_mg: tuple[tuple[float, float] | None, ...]
    training_ms: tuple[float, ...]
    rate_judged: tuple[int, ...]
    """Samples with an open needle and a standard deviation of the rate."""
    rate_covered: tuple[int, ...]
    """Of these, samples whose 95 % interval holds the true rate."""

    def estimator(self, name: str) -> EstimatorScore:
        """The score of an estimator. Raises KeyError when it did not run."""
        for estimator in self.estimators:
            if estimator.name == name:
                return estimator
        raise KeyError(name)

    def has(self, name: str) -> bool:
        """Whether an estimator ran on this case."""
        return any(estimator.name == name for estimator in self.estimators)

    @property
    def scored(self) -> list[Injection]:
        """The valid injections from the fifth event on, of which errors are stated."""
        return [each for each in self.injections if each.valid and each.event >= FROM]

    def errors_pct(self, name: str = OBSERVER) -> Array:
        """Signed mass error of every single injection that is scored."""
        return self._errors_pct(self.scored, name)

    def largest_error_pct(self, name: str = OBSERVER) -> float:
        """Of the single injections that are scored; 0 without any."""
        return float(np.max(np.abs(self.errors_pct(name)), initial=0.0))

    def sum_error_pct(self, name: str = OBSERVER) -> float | None:
        """Signed error of the mass of the same injections together, where errors cancel; None without any."""
        openings = [i for each in self.scored for i in each.openings]
        if not openings:
            return None
        mass, true = (
            sum(masses[i] for i in openings)
            for masses in (self.estimator(name).opening_mass_mg, self.true_opening_mass_mg)
        )
        return 100.0 * (mass / true - 1.0)

    def event_errors_pct(self, name: str = OBSERVER) -> Array:
        """Signed mass error of every event."""
        relative = np.array(self.estimator(name).mass_mg) / np.array(self.true_mass_mg)
        return np.asarray(100.0 * (relative - 1.0), np.float64)

    def rate_rmse(self, name: str = OBSERVER) -> float:
        """RMSE of the rate over the events from the fifth on together [mm3/ms]."""
        return math.sqrt(self._mean(self.estimator(name).rate_square_error))

    @property
    def x3_ratio(self) -> float:
        """How much smaller the observer's mean square error of x3 is than the nominal model's."""
        observer, nominal = (self._mean(self.estimator(name).x3_square_error) for name in (OBSERVER, NOMINAL))
        return nominal / observer if observer > 0.0 else math.inf

    @property
    def valid_share(self) -> float:
        """Valid events among those from the fifth on."""
        return float(np.mean(self.valid[SCORED]))

    @property
    def wrong_valid(self) -> int:
        """Single injections, of all events, that are valid and wrong."""
        valid = [each for each in self.injections if each.valid]
        squares = self.estimator(OBSERVER).rate_square_error
        rough = np.array([squares[each.event] > WRONG_RATE**2 for each in valid], np.bool_)
        return int(np.sum((np.abs(self._errors_pct(valid, OBSERVER)) > WRONG_MASS) | rough))

    def covered(self, event: int) -> bool | None:
        """Whether the 95 % interval of an event's (from 0) mass holds the true mass; None without interval."""
        interval = self.mass_ci95_mg[event]
        return None if interval is None else bool(interval[0] <= self.true_mass_mg[event] <= interval[1])

    @property
    def rate_coverage(self) -> float | None:
        """Share of the open samples from the fifth event on whose interval of the rate holds the truth, if any."""
        judged = sum(self.rate_judged[SCORED])
        return sum(self.rate_covered[SCORED]) / judged if judged else None

    def _errors_pct(self, injections: Sequence[Injection], name: str) -> Array:
        estimated, true = (
            np.array([sum(masses[i] for i in each.openings) for each in injections], np.float64)
            for masses in (self.estimator(name).opening_mass_mg, self.true_opening_mass_mg)
        )
        return np.asarray(100.0 * (estimated / true - 1.0), np.float64)

    def _mean(self, squares: tuple[float, ...]) -> float:
        weights = self.window_samples[SCORED]
        return float(np.average(squares[SCORED], weights=weights))


def covered_samples(error: Array, sigma: Array, windows: Windows) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Samples with an open needle and a standard deviation, and of these those within 1.96 of it, event by event.

    error, sigma: of the rate at every sample, in one unit; sigma is nan where it is not available.
    """
    available = np.isfinite(sigma)
    covered = available & (np.abs(error) <= Z_95 * np.where(available, sigma, 0.0))

    def counted(marked: NDArray[np.bool_]) -> tuple[int, ...]:
        return tuple(
            sum(int(np.sum(marked[windows.opened[i]])) for i in openings) for openings in windows.of_event
        )

    return counted(available), counted(covered)


def score_rate(
    name: str,
    rate: Array,
    truth: Truth,
    windows: Windows,
    density: float,
    x3_error: Array | None = None,
) -> EstimatorScore:
    """Score of an estimator's rate [m3/s] at every sample, and of its normalised sac pressure if it has one."""
    return EstimatorScore(
        name,
        windows.event_masses_mg(rate, density),
        windows.opening_masses_mg(rate, density),
        windows.mean_squares((rate - truth.injection_rate) / MM3_PER_MS),
        () if x3_error is None else windows.mean_squares(x3_error),
    )
