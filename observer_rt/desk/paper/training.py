"""Algorithm 1: the paper's training of phi on one event.

The paper's minimiser: BFGS on the inverse Hessian with an Armijo line search (14)-(18).

(17) is printed as the update of the Hessian but is, for the printed d and v, the DFP update of its inverse,
while (16) divides by H. Here the BFGS update of the inverse is used.
"""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from observer_rt.desk.paper import scheme
from observer_rt.engine.estimation.predictor import Window

SUFFICIENT_DECREASE = 1e-4  # rho of (18)
MOST_TRIALS = 40  # so many that a first inverse far too large still gives a step
EPOCHS = 30
BETA = 0.1  # of the scaled identities the weights start from
GAMMA = 1.0  # of the first approximation of the Hessian; of its inverse alike


class Objective(Protocol):
    """A cost J(theta) with its gradient; theta (m,)."""

    def value(self, theta: NDArray[np.float64]) -> float:
        """J(theta); inf outside the admissible region."""

    def gradient(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Gradient (m,) of J at the theta whose value was asked for last."""


class SearchEnd(NamedTuple):
    """End of a search: weights theta, value of the function there, number of iterations."""

    theta: NDArray[np.float64]
    value: float
    iterations: int


def minimise(
    objective: Objective, start: NDArray[np.float64], inverse_hessian: NDArray[np.float64], max_iterations: int
) -> SearchEnd:
    """Minimise from `start` (m,) with a first inverse Hessian (m, m).

    The update is skipped unless d'v > 0, and the inverse is reset to the first one when its direction does not
    lead downhill.
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
    objective: Objective, theta: NDArray[np.float64], value: float, direction: NDArray[np.float64], slope: float
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


def train(
    window: Window, setting: scheme.PaperSetting, in_force: NDArray[np.float64], start: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Weights p (48,): one pass over the event with those in force, then 30 epochs from those to start with.

    z is taken along x^, the target L l e~ from x~; both stay fixed while J is minimised (10).
    """
    seen = scheme.swept(window, setting, scheme.free_network(in_force, setting.gain))
    cost = scheme.FaultCost(*training_data(window, seen, setting), setting.gain)
    return minimise(cost, start, np.eye(scheme.WEIGHTS) / GAMMA, EPOCHS).theta


def training_data(
    window: Window, seen: scheme.EventPass, setting: scheme.PaperSetting
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Arguments z = [x^ u 1] (k, 6) and targets L l e~ (k, 3) [1/s] of the k samples driven by phi."""
    z = np.column_stack([seen.x, window.inputs[:, 0], np.maximum(window.inputs[:, 1], 0.0), np.ones(seen.error.size)])
    target = setting.gain * np.outer(seen.error, scheme.design_vector(setting.coefficients))
    return z[seen.driven], target[seen.driven]
