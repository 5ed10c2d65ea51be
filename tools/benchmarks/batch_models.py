"""What is learned in a batch: the observer's phi, the same with V trained, tied rows without structure."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.estimation.prediction_error import HUBER, EventCost, Linearisation, robust_cost
from observer_rt.estimation.predictor import NO_SLOPES, Setting, Window, correct, follow, innovations
from observer_rt.estimation.scalars import PARAMETERS, SCALARS, Learned, Parameter, learned_of
from observer_rt.model.network import ARGUMENTS, HIDDEN, constant_network, zero_network
from observer_rt.model.sensor import lagged
from observer_rt.observer.learning.fitting import Limits, theta_limits
from observer_rt.observer.paper_scheme.network import FreeNetwork, free_fault
from observer_rt.observer.paper_scheme.systems import PaperSetting, balanced_rate, design_vector, observe
from tools.benchmarks.batch_learning import Model

HIDDEN_PRIOR = 1.0  # of an element of V (one sigma), round where it starts
HIDDEN_DRIFT = 1e-2  # an event
DIFFERENCE = 1e-3  # of the prior sigma, for sensitivities
KNOWN = 1e-6  # of its usual prior: a parameter that is not learned
TIED_PRIOR = 0.45  # of weights and bias of the tied rows, in units of the nozzle flow at p_0
_NOZZLE_WEIGHTS = slice(Parameter.NOZZLE_WEIGHT, Parameter.NOZZLE_WEIGHT + HIDDEN)

Predict = Callable[[NDArray[np.float64]], NDArray[np.float64]]


class Correction(NamedTuple):
    """Gain (3,) of x~, and of the sensor the offset [p_0] and the lag [s]."""

    gain: NDArray[np.float64]
    offset: float
    lag: float


@njit(cache=True, nogil=True)
def sweep(
    window: Window,
    setting: PaperSetting,
    correction: Correction,
    network: FreeNetwork,
    corrected: int,
    innovations: NDArray[np.float64],
    rate: NDArray[np.float64],
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
        observe(x, u_start, u_end, setting, network)
        indicated = lagged(indicated, before, x[0], setting.interval, correction.lag)
        innovation = window.output[k] - correction.offset - indicated
        innovations[k] = innovation
        if k < corrected:
            indicated = correct(x, indicated, innovation, correction.gain, None)
        rate[k] = 0.0
        if window.resting[k]:
            x[2] = 0.0
        else:
            phi = free_fault(x, (u_end[0], max(u_end[1], 0.0)), network)
            rate[k] = balanced_rate(x[2], u_end[1], phi[0], setting.coefficients)


class DifferencedCost:
    """The learner's cost of an event, its sensitivities by finite differences."""

    def __init__(self, predict: Predict, steps: NDArray[np.float64], sigma: float, burn_in: int) -> None:
        """predict: innovations (n,) of theta (m,), a new array each time; steps: of the differences (m,)."""
        self._predict = predict
        self.innovations = np.empty(0)
        self.slopes = np.empty((0, 0))
        self._steps = steps
        self._sigma = sigma
        self._burn_in = burn_in

    def value(self, theta: NDArray[np.float64]) -> float:
        """J(theta), inf where it is not finite."""
        self.innovations = self.unfiltered = self._predict(theta)
        return self._cost()

    def linearised(self, theta: NDArray[np.float64]) -> Linearisation:
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
        def predict(theta: NDArray[np.float64]) -> NDArray[np.float64]:
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

    def swept(
        window: Window, setting: Setting, theta: NDArray[np.float64], corrected: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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
        def predict(theta: NDArray[np.float64]) -> NDArray[np.float64]:
            return swept(window, setting, theta, window.output.size)[0]

        return DifferencedCost(predict, steps, sigma, burn_in)

    def rate(window: Window, setting: Setting, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        return swept(window, setting, theta, window.opening)[1]

    return Model(prior, drift, theta_limits(scale), cost, rate)


def _with_hidden(theta: NDArray[np.float64], setting: Setting) -> Learned:
    """theta (m,), with the change of V appended or without."""
    learned = learned_of(theta, setting.coefficients)
    if theta.size == PARAMETERS:
        return learned
    hidden = learned.network.hidden + theta[PARAMETERS:].reshape(HIDDEN, ARGUMENTS)
    return learned._replace(network=learned.network._replace(hidden=hidden))


def _structured_rate(window: Window, setting: Setting, theta: NDArray[np.float64]) -> NDArray[np.float64]:
    errors, rate = np.zeros((2, window.output.size))
    follow(window, setting, _with_hidden(theta, setting), window.opening, errors, rate, None, NO_SLOPES)
    return rate
