"""The paper's minimiser: BFGS on the inverse Hessian with an Armijo line search (14)-(18).

(17) is printed as the update of the Hessian but is, for the printed d and v, the DFP update of its inverse,
while (16) divides by H. Here the BFGS update of the inverse is used.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

SUFFICIENT_DECREASE = 1e-4  # rho of (18)
MAX_HALVINGS = 40  # so many that a first inverse far too large still gives a step


class Objective(Protocol):
    """A cost J(theta) with its gradient; theta (m,)."""

    def value(self, theta: NDArray[np.float64]) -> float:
        """J(theta); inf outside the admissible region."""

    def value_and_gradient(self, theta: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """J(theta) and its gradient (m,)."""


@dataclass(frozen=True)
class Minimum:
    """Where the search ended. `decrement` is g' H^-1 g there: about twice what J could still fall."""

    theta: NDArray[np.float64]
    value: float
    gradient: NDArray[np.float64]
    iterations: int
    decrement: float
    converged: bool


def minimise(
    objective: Objective,
    start: NDArray[np.float64],
    inverse_hessian: NDArray[np.float64],
    tolerance: float,
    max_iterations: int,
) -> Minimum:
    """Minimise from `start` (m,) with a first inverse Hessian (m, m), until the decrement is below `tolerance`.

    The update is skipped unless d'v > 0, and the inverse is reset to the first one when its direction does not
    lead downhill.
    """
    theta = start
    inverse = inverse_hessian
    value, gradient = objective.value_and_gradient(theta)
    for iteration in range(max_iterations):
        direction = -inverse @ gradient
        slope = float(gradient @ direction)
        if not slope < 0.0:
            inverse = inverse_hessian
            direction = -inverse @ gradient
            slope = float(gradient @ direction)
        if 0.0 <= -slope <= tolerance:
            return Minimum(theta, value, gradient, iteration, -slope, converged=True)
        step = _armijo(objective, theta, value, direction, slope) if slope < 0.0 else 0.0  # or no number
        if step == 0.0:
            return Minimum(theta, value, gradient, iteration, -slope, converged=False)
        previous_gradient = gradient
        theta = theta + step * direction
        value, gradient = objective.value_and_gradient(theta)
        inverse = _updated(inverse, step * direction, gradient - previous_gradient)
    return Minimum(
        theta, value, gradient, max_iterations, float(gradient @ inverse @ gradient), converged=False
    )


def _armijo(
    objective: Objective,
    theta: NDArray[np.float64],
    value: float,
    direction: NDArray[np.float64],
    slope: float,
) -> float:
    """Largest of 1, 1/2, 1/4 .. that decreases J sufficiently (18); 0 when none does."""
    step = 1.0
    for _ in range(MAX_HALVINGS):
        if objective.value(theta + step * direction) < value + SUFFICIENT_DECREASE * step * slope:
            return step
        step *= 0.5
    return 0.0


def _updated(
    inverse: NDArray[np.float64], v: NDArray[np.float64], d: NDArray[np.float64]
) -> NDArray[np.float64]:
    """BFGS update of the inverse Hessian for a step v and a change of gradient d."""
    curvature = float(d @ v)
    if not curvature > 0.0:
        return inverse
    inverse_d = inverse @ d
    mixed = np.outer(inverse_d, v)
    return (
        inverse
        - (mixed + mixed.T) / curvature
        + (1.0 + float(d @ inverse_d) / curvature) * np.outer(v, v) / curvature
    )
