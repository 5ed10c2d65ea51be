"""The learner's problem outside the observer: for parts that cannot be exchanged inside it.

Same windows, whitened innovations, prior, drift, gate and accumulated information as the observer's learner, but no
test for sudden change, no tempering, no adoption test: an event's rate is that of what was learned before it.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.gain import NoiseLevels, gain_schedule
from observer_rt.estimation.gating import Belief, best_subset, prior_belief
from observer_rt.estimation.prediction_error import Linearisation
from observer_rt.estimation.predictor import Setting, Window
from observer_rt.estimation.scalars import SCALARS, Parameter, learned_of
from observer_rt.foundation.units import MILLISECOND
from observer_rt.observer.learning.adequacy import BURN_IN
from observer_rt.observer.learning.explained import FIRST_ITERATIONS, ITERATIONS
from observer_rt.observer.learning.fitting import TOLERANCE, Cost, EventFitter, Limits
from observer_rt.observer.learning.knowledge import EventLearner, OverheardLearner
from observer_rt.observer.paper_scheme.training import minimise
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.observer.stream.state import Constants

BFGS_ITERATIONS = 12
SUBSETS_TRIED = 3  # of the gated scalars, between searches over the active ones


@dataclass(frozen=True, eq=False)
class Start:
    """Where a search begins: the cost's linearisation there, what is believed, which scalars are active."""

    here: Linearisation
    prior: Belief
    active: frozenset[int]
    limits: Limits
    iterations: int


Search = Callable[[Cost, Start], tuple[Linearisation, frozenset[int]]]


@dataclass(frozen=True, eq=False)
class Model:
    """What is learned: prior and drift (m,), limits, the cost of an event, its open-loop rate (n,) [m3/s].

    cost: of a window, a setting, the innovations' sigma and the samples that do not count.
    """

    prior: NDArray[np.float64]
    drift: NDArray[np.float64]
    limits: Limits
    cost: Callable[[Window, Setting, float, int], Cost]
    rate: Callable[[Window, Setting, NDArray[np.float64]], NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class SeenEvent:
    """An event as the observer's learner was given it; `first`: the recording's sample its window begins at."""

    window: Window
    standstill: Standstill
    first: int


class Listener(OverheardLearner):
    """A learner that keeps what it is given, and lets another one learn."""

    def __init__(self, learner: EventLearner) -> None:
        super().__init__(learner, lambda window, standstill: self.heard.append((window, standstill)))
        self.heard: list[tuple[Window, Standstill]] = []


@dataclass(frozen=True, eq=False)
class BatchResult:
    """Rate [m3/s] of every sample, 0 outside the events' windows; milliseconds of one core for each event."""

    rate: NDArray[np.float64]
    training_ms: tuple[float, ...]


def learn_events(
    model: Model,
    search: Search,
    events: Sequence[SeenEvent],
    samples: int,
    constants: Constants,
    noise: NoiseLevels,
) -> BatchResult:
    """Learn event after event of a recording of `samples`; an event that cannot be learned changes nothing."""
    rate, training = np.zeros(samples), []
    theta = np.zeros(model.prior.size)
    belief = prior_belief(theta, np.diag(model.prior**2))
    active: frozenset[int] = frozenset()
    for number, event in enumerate(events):
        noise = event.standstill.noise or noise
        setting, sigma = _setting(constants, theta, noise)
        rate[event.first : event.first + event.window.output.size] = model.rate(event.window, setting, theta)
        begin = time.thread_time()
        if number == 0:
            theta[Parameter.LINE_PRESSURE_OFFSET] = event.standstill.offset
            belief = replace(belief, mean=theta.copy())
        else:
            belief = belief.drifted(model.drift)
        cost = model.cost(event.window, setting, sigma, round(BURN_IN / constants.interval))
        iterations = FIRST_ITERATIONS if number == 0 else ITERATIONS
        first = cost.linearised(theta)
        start = Start(first, belief, active, model.limits, iterations)
        if np.isfinite(first.value):
            try:
                found, active = search(cost, start)
                belief, theta = belief.updated(found.information, found.vector), found.theta
            except np.linalg.LinAlgError:
                pass  # singular: nothing learned
        training.append((time.thread_time() - begin) / MILLISECOND)
    return BatchResult(rate, tuple(training))


def gauss_newton(cost: Cost, start: Start) -> tuple[Linearisation, frozenset[int]]:
    """As the observer's learner searches."""
    fit = EventFitter(cost, SCALARS.gate, start.active, start.limits).fit(
        start.here, start.prior, start.iterations
    )
    return fit.linearisation, fit.active


def bfgs(cost: Cost, start: Start) -> tuple[Linearisation, frozenset[int]]:
    """BFGS with Armijo's rule from the Gauss-Newton inverse, over the free and active parameters."""
    information = start.prior.information
    here, active = start.here, start.active
    for _ in range(SUBSETS_TRIED):
        total_information = information + here.information
        before = active
        _, active = best_subset(
            total_information, information @ start.prior.mean + here.vector, SCALARS.gate, active
        )
        columns = [i for i in range(here.theta.size) if i not in SCALARS.gate.columns or i in active]
        theta = np.zeros_like(here.theta)
        theta[columns] = here.theta[columns]
        objective = _Restricted(cost, start, information, columns)
        inverse = np.asarray(np.linalg.inv(total_information[np.ix_(columns, columns)]), np.float64)
        found = minimise(objective, theta[columns], inverse, TOLERANCE, BFGS_ITERATIONS)
        theta[columns] = found.theta
        here = cost.linearised(theta)
        if active == before:
            break
    return here, active


class _Restricted:
    """Cost and prior as functions of some of the parameters, the others 0."""

    def __init__(
        self, cost: Cost, start: Start, information: NDArray[np.float64], columns: list[int]
    ) -> None:
        self._cost = cost
        self._start = start
        self._information = information
        self._columns = columns

    def value(self, theta: NDArray[np.float64]) -> float:
        """J; inf outside the bounds."""
        full = self._full(theta)
        if np.any(full < self._start.limits.lowest) or np.any(full > self._start.limits.highest):
            return np.inf
        return _total(full, self._cost.value(full), self._start.prior, self._information)

    def value_and_gradient(self, theta: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """J and its gradient."""
        full = self._full(theta)
        here = self._cost.linearised(full)
        gradient = here.gradient + self._information @ (full - self._start.prior.mean)
        return _total(full, here.value, self._start.prior, self._information), gradient[self._columns]

    def _full(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        full = np.zeros(self._start.here.theta.size)
        full[self._columns] = theta
        return full


def _total(
    theta: NDArray[np.float64], value: float, prior: Belief, information: NDArray[np.float64]
) -> float:
    distance = theta - prior.mean
    return value + 0.5 * float(distance @ information @ distance)


def _setting(constants: Constants, theta: NDArray[np.float64], noise: NoiseLevels) -> tuple[Setting, float]:
    learned = learned_of(theta, constants.coefficients)
    schedule = gain_schedule(learned.coefficients, noise, 1.0 / constants.interval, learned.lag)
    setting = Setting(
        constants.interval, constants.substeps, constants.coefficients, schedule.gains[-1].copy()
    )
    return setting, schedule.innovation_sigma
