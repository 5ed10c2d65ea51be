"""The paper's scheme: three free rows phi = unit (W tanh(V z) + b), cost (10), gradient (13), its pair over an event.

The pair is the identification system (5) and the observer (26). Algorithm 1 trains phi on one event: BFGS with an
Armijo line search (14)-(18).

Erratum: (5) is printed with a minus, which with y - C x~ is positive feedback. Here

    x~' = f(x~, u) + l C^T (y - C x~)        x^' = f(x^, u) + phi(x^, u)

Erratum: (6) as printed uses x~', where Talebi has the derivative of e = y - C x^, and so adds a pressure rate to
rates it does not belong to. Exactly, and without a derivative,

    eps = L (e~' + l e~ - C phi) ~ L l e~ - phi,    e~ = y - C x~,

for which the gradient (13) is exact. L = [1 0 a6/a2]^T, the paper's [1 0 12]^T for the nominal injector: what the
nozzle flow lacks is missed by line and sac in this ratio (27).

Erratum: (17) is printed as the update of the Hessian but is, for the printed d and v, the DFP update of its inverse,
while (16) divides by H. Here the BFGS update of the inverse is used.
"""

from typing import NamedTuple, Protocol

import numpy as np

from observer_rt.core.model.laws import take_tanh
from observer_rt.core.paper.scheme import sweep
from observer_rt.engine.estimation.predictor import Window
from observer_rt.foundation.units import Bools, Floats
from observer_rt.model.effective import Coefficients
from observer_rt.model.network import Network, constant_network

HIDDEN, ARGUMENTS = 5, 6  # q; z = [x1 x2 x3 u1 u2 1]
ROWS = 3  # m, one output for every state
LANES = 8  # samples reckoned together
WEIGHTS = HIDDEN * ARGUMENTS + ROWS * HIDDEN + ROWS

_HIDDEN_END = HIDDEN * ARGUMENTS
_OUTPUT_END = _HIDDEN_END + ROWS * HIDDEN
SUFFICIENT_DECREASE = 1e-4  # rho of (18)
MOST_TRIALS = 40  # so many that a first inverse far too large still gives a step
EPOCHS = 30
BETA = 0.1  # of the scaled identities the weights start from
GAMMA = 1.0  # of the first approximation of the Hessian; of its inverse alike


class FreeNetwork(NamedTuple):
    """Weights of (7)-(8): `hidden` V (5, 6), `output` W (3, 5), `bias` b (3,); `unit` [1/s] of the outputs.

    The paper states no unit of time. Here it is 1/l, in which the gain of (5) is 1 as printed: `unit` is l.
    """

    hidden: Floats
    output: Floats
    bias: Floats
    unit: float


def free_network(p: Floats, unit: float) -> FreeNetwork:
    """The network of p = [v_1 .. v_q, rows of W, b] (48,): by rows as (13), where (12) orders W by columns."""
    return FreeNetwork(
        p[:_HIDDEN_END].reshape(HIDDEN, ARGUMENTS),
        p[_HIDDEN_END:_OUTPUT_END].reshape(ROWS, HIDDEN),
        p[_OUTPUT_END:],
        unit,
    )


def scaled_identity(beta: float) -> Floats:
    """The start of Algorithm 1, V = W = b = beta I, as a vector p (48,): beta on main diagonals, and in all of b."""
    return np.concatenate(
        [beta * np.eye(HIDDEN, ARGUMENTS).ravel(), beta * np.eye(ROWS, HIDDEN).ravel(), np.full(ROWS, beta)]
    )


def no_fault() -> Floats:
    """The vector p (48,) of a network that says phi = 0."""
    return np.zeros(WEIGHTS)


class FaultCost:
    """The cost (10) of a training: the sum of eps'eps/2, eps = target - phi in its unit.

    Sums go by lanes of eight samples: their order decides the result of thirty epochs.
    """

    def __init__(self, z: Floats, target: Floats, unit: float) -> None:
        """Samples z: (n, 6) rows [x^ u 1]; target of phi: (n, 3) [1/s]; unit of the outputs [1/s]."""
        spare = ((0, -len(z) % LANES), (0, 0))
        self._z = np.ascontiguousarray(np.pad(z, spare).T)
        self._target = np.ascontiguousarray(np.pad(target / unit, spare).T)
        self._counts = np.arange(self._z.shape[1]) < len(z)

    def value(self, p: Floats) -> float:
        """J at p (48,); inf where it is not finite."""
        network = free_network(p, 1.0)
        sigmas = network.hidden[:, :1] * self._z[0]
        for j in range(1, ARGUMENTS):
            sigmas += network.hidden[:, j : j + 1] * self._z[j]
        take_tanh(sigmas)
        phi = np.repeat(network.bias[:, np.newaxis], sigmas.shape[1], axis=1)
        for neuron, sigma in enumerate(sigmas):
            phi += network.output[:, neuron : neuron + 1] * sigma
        self._sigmas, self._errors = sigmas, self._counts * (self._target - phi)
        squares = (self._errors**2).reshape(ROWS, -1, LANES).swapaxes(0, 1)
        total = 0.5 * float(_sums(squares.reshape(1, -1))[0])
        return total if np.isfinite(total) else np.inf

    def gradient(self, p: Floats) -> Floats:
        """Gradient (48,) of J at the p whose value was asked for last, in the order of `free_network`.

        (13) prints the slope of sigma_i as (sigma_i + 1)^2 / exp(2 v_i z), which is 1 - sigma_i^2 of tanh (9).
        """
        network, sigmas, errors = free_network(p, 1.0), self._sigmas, self._errors
        back = network.output[0][:, np.newaxis] * errors[0]
        for row in range(1, ROWS):
            back += network.output[row][:, np.newaxis] * errors[row]
        back *= 1.0 - sigmas**2
        by_hidden = _sums((back[:, np.newaxis] * self._z).reshape(HIDDEN * ARGUMENTS, -1))
        by_output = _sums((errors[:, np.newaxis] * sigmas).reshape(ROWS * HIDDEN, -1))
        return -np.concatenate([by_hidden, by_output, _sums(errors)])


def _sums(values: Floats) -> Floats:
    lanes = np.add.reduce(values.reshape(len(values), -1, LANES), axis=1)
    return np.asarray(np.cumsum(lanes, axis=1)[:, -1])


class PaperSetting(NamedTuple):
    """Constants from event to event."""

    interval: float  # of the samples [s]
    substeps: int  # RK4 steps in it
    coefficients: Coefficients
    gain: float  # l [1/s]
    nominal: Network = constant_network()  # says phi = 0, for f(x, u) itself


class EventPass(NamedTuple):
    """One event swept once, n samples."""

    x: Floats  # (n, 3) x^
    phi: Floats  # (n, 3) [1/s]
    rate: Floats  # (n,) Q_H^ [m3/s]
    error: Floats  # (n,) e~ [p_0]
    driven: Bools  # (n,) where x^ runs on phi; before the opening and with the needle long shut it is x~


def design_vector(c: Coefficients) -> Floats:
    """L = [1 0 a6/a2]^T (3,), which gives line and sac their share of the measured error."""
    return np.array([1.0, 0.0, c.sac.a6 / c.line.a2_nozzle])


def swept(window: Window, setting: PaperSetting, network: FreeNetwork) -> EventPass:
    """One pass over an event (n samples) with fixed weights, into new memory."""
    samples = window.output.shape[0]
    result = EventPass(
        x=np.zeros((samples, 3)),
        phi=np.zeros((samples, 3)),
        rate=np.zeros(samples),
        error=np.zeros(samples),
        driven=np.zeros(samples, np.bool_),
    )
    sweep(window, setting, network, result)
    return result


class Objective(Protocol):
    """A cost J(theta) with its gradient; theta (m,)."""

    def value(self, theta: Floats) -> float:
        """J(theta); inf outside the admissible region."""

    def gradient(self, theta: Floats) -> Floats:
        """Gradient (m,) of J at the theta whose value was asked for last."""


class SearchEnd(NamedTuple):
    """End of a search: weights theta, value of the function there, number of iterations."""

    theta: Floats
    value: float
    iterations: int


def minimise(objective: Objective, start: Floats, inverse_hessian: Floats, max_iterations: int) -> SearchEnd:
    """Minimise from `start` (m,) with a first inverse Hessian (m, m).

    The update is skipped unless d'v > 0, and the inverse is reset where its direction does not lead downhill.
    """
    theta, inverse = start.copy(), inverse_hessian.copy()
    value = objective.value(theta)
    gradient = objective.gradient(theta)
    for iteration in range(max_iterations):
        direction = -(inverse @ gradient)
        slope = float(gradient @ direction)
        if not slope < 0.0:
            inverse = inverse_hessian.copy()
            direction = -(inverse @ gradient)
            slope = float(gradient @ direction)
        step = 0.0
        if slope < 0.0:  # or no number
            step, value = _armijo(objective, theta, value, direction, slope)
        if step == 0.0:
            return SearchEnd(theta, value, iteration)
        before, theta = gradient, theta + step * direction
        gradient = objective.gradient(theta)
        v, d = step * direction, gradient - before
        curvature = d @ v
        if curvature > 0.0:  # BFGS update of the inverse Hessian
            inverse_d = inverse @ d
            share = (1.0 + (d @ inverse_d) / curvature) / curvature
            inverse += np.outer(share * v - inverse_d / curvature, v) + np.outer(-v / curvature, inverse_d)
    return SearchEnd(theta, value, max_iterations)


def _armijo(
    objective: Objective, theta: Floats, value: float, direction: Floats, slope: float
) -> tuple[float, float]:
    """A step that decreases J sufficiently (18), and J there: 1, halved as often as need be; 0 if none does.

    Shortened by a parabola instead, the training of some injections ends in a valley that explains nothing.
    """
    step = 1.0
    for _ in range(MOST_TRIALS):
        trial = objective.value(theta + step * direction)
        if trial < value + SUFFICIENT_DECREASE * step * slope:
            return step, trial
        step *= 0.5
    return 0.0, value


def train(window: Window, setting: PaperSetting, in_force: Floats, start: Floats) -> Floats:
    """Weights p (48,): one pass over the event with those in force, then 30 epochs from those to start with.

    z is taken along x^, the target L l e~ from x~; both stay fixed while J is minimised (10).
    """
    seen = swept(window, setting, free_network(in_force, setting.gain))
    cost = FaultCost(*training_data(window, seen, setting), setting.gain)
    return minimise(cost, start, np.eye(WEIGHTS) / GAMMA, EPOCHS).theta


def training_data(window: Window, seen: EventPass, setting: PaperSetting) -> tuple[Floats, Floats]:
    """Arguments z = [x^ u 1] (k, 6) and targets L l e~ (k, 3) [1/s] of the k samples driven by phi."""
    z = np.column_stack([seen.x, window.inputs[:, 0], np.maximum(window.inputs[:, 1], 0.0), np.ones(seen.error.size)])
    target = setting.gain * np.outer(seen.error, design_vector(setting.coefficients))
    return z[seen.driven], target[seen.driven]
