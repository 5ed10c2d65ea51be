"""The learner's problem outside the observer: for parts that cannot be exchanged inside it.

Same windows, whitened innovations, prior, drift, gate and accumulated information as the observer's learner, but no
test for sudden change, no tempering, no adoption test: an event's rate is that of what was learned before it. What is
learned: the observer's phi, the same with V trained, tied rows without structure.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from observer_rt.core.learning.predictor import follow
from observer_rt.core.learning.whitening import HUBER, robust_cost
from observer_rt.core.model.laws import lagged
from observer_rt.core.paper.scheme import fault_of, observe_interval, rate_by_balance
from observer_rt.engine.estimation.gain import NoiseLevels, gain_schedule
from observer_rt.engine.estimation.gating import Belief, best_subset, prior_belief
from observer_rt.engine.estimation.prediction_error import EventCost, Linearisation
from observer_rt.engine.estimation.predictor import NO_SLOPES, Setting, Window, innovations
from observer_rt.engine.estimation.scalars import PARAMETERS, SCALARS, Learned, Parameter, learned_of
from observer_rt.engine.learning.adequacy import BURN_IN
from observer_rt.engine.learning.explained import FIRST_ITERATIONS, ITERATIONS
from observer_rt.engine.learning.fitting import TOLERANCE, Cost, EventFitter, Limits, theta_limits
from observer_rt.engine.learning.knowledge import EventLearner, Outcome
from observer_rt.engine.paper_scheme.network import FreeNetwork
from observer_rt.engine.paper_scheme.systems import PaperSetting, design_vector
from observer_rt.engine.paper_scheme.training import minimise
from observer_rt.engine.stream.standstill import Standstill
from observer_rt.engine.stream.state import Constants
from observer_rt.foundation.units import MILLISECOND
from observer_rt.model.network import ARGUMENTS, HIDDEN, constant_network, zero_network
from tools.benchmarks.arrays import Array

BFGS_ITERATIONS = 12
SUBSETS_TRIED = 3  # of the gated scalars, between searches over the active ones
HIDDEN_PRIOR = 1.0  # of an element of V (one sigma), round where it starts
HIDDEN_DRIFT = 1e-2  # an event
DIFFERENCE = 1e-3  # of the prior sigma, for sensitivities
KNOWN = 1e-6  # of its usual prior: a parameter that is not learned
TIED_PRIOR = 0.45  # of weights and bias of the tied rows, in units of the nozzle flow at p_0
_NOZZLE_WEIGHTS = slice(Parameter.NOZZLE_WEIGHT, Parameter.NOZZLE_WEIGHT + HIDDEN)


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

    prior: Array
    drift: Array
    limits: Limits
    cost: Callable[[Window, Setting, float, int], Cost]
    rate: Callable[[Window, Setting, Array], Array]


@dataclass(frozen=True, eq=False)
class SeenEvent:
    """An event as the observer's learner was given it; `first`: the recording's sample its window begins at."""

    window: Window
    standstill: Standstill
    first: int


class Listener:
    """A learner that keeps what it is given, and lets another one learn."""

    def __init__(self, learner: EventLearner) -> None:
        self.heard: list[tuple[Window, Standstill]] = []
        self.schedule, self.phi = learner.schedule, learner.phi
        self._learner = learner

    def learn(
        self, window: Window, standstill: Standstill, in_force: Array, constants: Constants | None = None
    ) -> Outcome:
        """Keep an event, and let it be learned from."""
        self.heard.append((window, standstill))
        return self._learner.learn(window, standstill, in_force, constants)


@dataclass(frozen=True, eq=False)
class BatchResult:
    """Rate [m3/s] of every sample, 0 outside the events' windows; milliseconds of one core for each event."""

    rate: Array
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
        learned, c = learned_of(theta, constants.coefficients), constants.coefficients
        schedule = gain_schedule(learned.coefficients, noise, 1.0 / constants.interval, learned.lag)
        setting = Setting(constants.interval, constants.substeps, c, schedule.gains[-1].copy())
        rate[event.first : event.first + event.window.output.size] = model.rate(event.window, setting, theta)
        begin = time.thread_time()
        if number == 0:
            theta[Parameter.LINE_PRESSURE_OFFSET] = event.standstill.offset
            belief = replace(belief, mean=theta.copy())
        else:
            belief = belief.drifted(model.drift)
        burn_in = round(BURN_IN / constants.interval)
        cost = model.cost(event.window, setting, schedule.innovation_sigma, burn_in)
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

    def __init__(self, cost: Cost, start: Start, information: Array, columns: list[int]) -> None:
        self._cost = cost
        self._start = start
        self._information = information
        self._columns = columns

    def value(self, theta: Array) -> float:
        """J; inf outside the bounds."""
        full = self._full(theta)
        if np.any(full < self._start.limits.lowest) or np.any(full > self._start.limits.highest):
            return np.inf
        return self._total(full, self._cost.value(full))

    def value_and_gradient(self, theta: Array) -> tuple[float, Array]:
        """J and its gradient."""
        full = self._full(theta)
        here = self._cost.linearised(full)
        gradient = here.gradient + self._information @ (full - self._start.prior.mean)
        return self._total(full, here.value), gradient[self._columns]

    def _total(self, theta: Array, value: float) -> float:
        distance = theta - self._start.prior.mean
        return value + 0.5 * float(distance @ self._information @ distance)

    def _full(self, theta: Array) -> Array:
        full = np.zeros(self._start.here.theta.size)
        full[self._columns] = theta
        return full


Predict = Callable[[Array], Array]


class Correction(NamedTuple):
    """Gain (3,) of x~, and of the sensor the offset [p_0] and the lag [s]."""

    gain: Array
    offset: float
    lag: float


def sweep(
    window: Window,
    setting: PaperSetting,
    correction: Correction,
    network: FreeNetwork,
    corrected: int,
    innovations: Array,
    rate: Array,
) -> None:
    """Innovations (n,) of x~ [p_0] and injection rate (n,) [m3/s]; from sample `corrected` on it runs open loop.

    Nothing holds phi at 0 while the needle is shut; only when it has long been is the sac at rest and the rate 0.
    """
    x = window.start[:-1].copy()
    indicated = window.start[-1]
    innovations[0] = 0.0
    rate[0] = 0.0
    for k in range(1, window.output.shape[0]):
        u_start = (window.inputs[k - 1, 0], window.inputs[k - 1, 1])
        u_end = (window.inputs[k, 0], window.inputs[k, 1])
        before = x[0]
        observe_interval(x, u_start, u_end, setting, network)
        indicated = lagged(indicated, before, x[0], setting.interval, correction.lag)
        innovation = window.output[k] - correction.offset - indicated
        innovations[k] = innovation
        if k < corrected:
            x[:2] += correction.gain[:2] * innovation
            indicated += correction.gain[2] * innovation
        rate[k] = 0.0
        if window.resting[k]:
            x[2] = 0.0
        else:
            phi = fault_of(x, (u_end[0], max(u_end[1], 0.0)), network)
            rate[k] = rate_by_balance(x[2], u_end[1], phi[0], setting.coefficients)


class DifferencedCost:
    """The learner's cost of an event, its sensitivities by finite differences."""

    def __init__(self, predict: Predict, steps: Array, sigma: float, burn_in: int) -> None:
        """predict: innovations (n,) of theta (m,), a new array each time; steps: of the differences (m,)."""
        self._predict = predict
        self.innovations = np.empty(0)
        self.slopes = np.empty((0, 0))
        self._steps = steps
        self._sigma = sigma
        self._burn_in = burn_in

    def value(self, theta: Array) -> float:
        """J(theta), inf where it is not finite."""
        self.innovations = self.unfiltered = self._predict(theta)
        return self._cost()

    def linearised(self, theta: Array) -> Linearisation:
        """J round theta (m,)."""
        self.innovations = self.unfiltered = base = self._predict(theta)
        slopes = np.empty((base.size, theta.size))
        for i, step in enumerate(self._steps):
            moved = theta.copy()
            moved[i] += step
            slopes[:, i] = (self._predict(moved) - base) / step
        self.slopes = slopes
        errors, slopes = base[self._burn_in :] / self._sigma, slopes[self._burn_in :] / self._sigma
        weights = np.minimum(1.0, HUBER / np.maximum(np.abs(errors), 1e-12))
        weighted = slopes * weights[:, np.newaxis]
        return Linearisation(theta, self._cost(), weighted.T @ errors, weighted.T @ slopes)

    def _cost(self) -> float:
        cost = robust_cost(self.innovations, self._burn_in, self._sigma)
        return cost if np.isfinite(cost) else np.inf


def shipped_model(scale: float) -> Model:
    """The observer's own: nozzle and seat factors with V fixed, line and sensor terms. scale: p_0 [Pa]."""
    return Model(SCALARS.prior(scale), SCALARS.drift(scale), theta_limits(scale), EventCost, _structured_rate)


def trained_hidden_model(scale: float) -> Model:
    """The same with V (5, 6) learned, appended to theta as the change from where it starts."""
    prior = np.append(SCALARS.prior(scale), np.full(HIDDEN * ARGUMENTS, HIDDEN_PRIOR))
    drift = np.append(SCALARS.drift(scale), np.full(HIDDEN * ARGUMENTS, HIDDEN_DRIFT))
    far = np.full(HIDDEN * ARGUMENTS, 10.0 * HIDDEN_PRIOR)

    def cost(window: Window, setting: Setting, sigma: float, burn_in: int) -> DifferencedCost:
        def predict(theta: Array) -> Array:
            result = np.zeros(window.output.size)
            innovations(window, setting, _with_hidden(theta, setting), result)
            return result

        return DifferencedCost(predict, DIFFERENCE * prior, sigma, burn_in)

    of_observer = theta_limits(scale)
    limits = Limits(
        np.append(of_observer.lowest, -far),
        np.append(of_observer.highest, far),
        np.append(of_observer.longest_step, far),
    )
    return Model(prior, drift, limits, cost, _structured_rate)


def tied_rows_model(scale: float) -> Model:
    """phi = L (w tanh(V z) + b), L = [1 0 a6/a2], in place of nozzle and seat factors; line and sensor terms stay."""
    prior, drift = SCALARS.prior(scale), SCALARS.drift(scale)
    prior[_NOZZLE_WEIGHTS] = TIED_PRIOR
    steps = DIFFERENCE * prior
    prior[Parameter.SEAT_BIAS] *= KNOWN
    drift[Parameter.SEAT_BIAS] = 0.0

    def swept(window: Window, setting: Setting, theta: Array, corrected: int) -> tuple[Array, Array]:
        learned = learned_of(theta, setting.coefficients)
        c = learned.coefficients
        weights = np.append(theta[_NOZZLE_WEIGHTS], theta[Parameter.NOZZLE_BIAS])
        rows = -np.outer(design_vector(c), weights)
        network = FreeNetwork(
            zero_network().hidden,
            np.ascontiguousarray(rows[:, :HIDDEN]),
            rows[:, HIDDEN].copy(),
            c.line.a2_nozzle,
        )
        errors, rate = np.zeros((2, window.output.size))
        sweep(
            window,
            PaperSetting(setting.interval, setting.substeps, c, constant_network(), c.line.a2_nozzle),
            Correction(setting.gain, learned.offset, learned.lag),
            network,
            corrected,
            errors,
            rate,
        )
        return errors, rate

    def cost(window: Window, setting: Setting, sigma: float, burn_in: int) -> DifferencedCost:
        def predict(theta: Array) -> Array:
            return swept(window, setting, theta, window.output.size)[0]

        return DifferencedCost(predict, steps, sigma, burn_in)

    def rate(window: Window, setting: Setting, theta: Array) -> Array:
        return swept(window, setting, theta, window.opening)[1]

    return Model(prior, drift, theta_limits(scale), cost, rate)


def _with_hidden(theta: Array, setting: Setting) -> Learned:
    """theta (m,), with the change of V appended or without."""
    learned = learned_of(theta, setting.coefficients)
    if theta.size == PARAMETERS:
        return learned
    hidden = learned.network.hidden + theta[PARAMETERS:].reshape(HIDDEN, ARGUMENTS)
    return learned._replace(network=learned.network._replace(hidden=hidden))


def _structured_rate(window: Window, setting: Setting, theta: Array) -> Array:
    errors, rate = np.zeros((2, window.output.size))
    follow(window, setting, _with_hidden(theta, setting), window.opening, errors, rate, None, NO_SLOPES)
    return rate
