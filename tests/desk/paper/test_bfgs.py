"""The minimiser against scipy's BFGS, and what it does where the textbook's assumptions end."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import minimize, rosen, rosen_der

from observer_rt.desk.paper.training import SearchEnd, minimise

Vector = NDArray[np.float64]


class Function:
    """A cost with its gradient, which notes where the gradient was asked for."""

    def __init__(self, cost: Callable[[Vector], float], gradient: Callable[[Vector], Vector]) -> None:
        self._cost = cost
        self._gradient = gradient
        self.visited: list[Vector] = []

    def value(self, theta: Vector) -> float:
        return float(self._cost(theta))

    def gradient(self, theta: Vector) -> Vector:
        self.visited.append(theta.copy())
        return np.asarray(self._gradient(theta), np.float64)


def found(function: Function, start: list[float], iterations: int = 500, first: float = 1.0) -> SearchEnd:
    return minimise(function, np.array(start), first * np.eye(len(start)), iterations)


def quadratic(hessian: Vector, centre: Vector) -> Function:
    return Function(
        lambda t: float(0.5 * (t - centre) @ hessian @ (t - centre)), lambda t: hessian @ (t - centre)
    )


def rotated(curvatures: list[float]) -> Vector:
    """A matrix with these eigenvalues, its axes turned (always the same way)."""
    axes, _ = np.linalg.qr(np.random.default_rng(2).normal(size=(len(curvatures), len(curvatures))))
    hessian: Vector = axes @ np.diag(curvatures) @ axes.T
    return hessian


FUNCTIONS = {
    "ill-conditioned": (
        quadratic(rotated([1e-3, 1.0, 10.0, 1e3]), np.array([1.0, -2.0, 3.0, 0.5])),
        [0.0] * 4,
    ),
    "banana": (Function(rosen, rosen_der), [-1.2, 1.0]),
    "banana in five": (Function(rosen, rosen_der), [0.8, 1.3, 0.6, 1.1, 0.9]),
    "valley": (
        Function(
            lambda t: math.log(math.cosh(3 * t[0])) + (t[1] - t[0] ** 2) ** 2,
            lambda t: np.array(
                [3 * math.tanh(3 * t[0]) - 4 * t[0] * (t[1] - t[0] ** 2), 2 * (t[1] - t[0] ** 2)]
            ),
        ),
        [1.5, -1.0],
    ),
}


@pytest.mark.filterwarnings("ignore:overflow")  # at the end of a valley, where the curvature is none
@pytest.mark.parametrize("name", FUNCTIONS)
def test_same_minimum_as_scipy(name: str) -> None:
    function, start = FUNCTIONS[name]
    minimum = found(function, start)
    reference = minimize(
        function.value,
        start,
        jac=function.gradient,
        method="BFGS",
        options={"gtol": 1e-9},
    )
    np.testing.assert_allclose(minimum.theta, reference.x, atol=2e-5)
    assert minimum.value == pytest.approx(reference.fun, abs=1e-10)
    assert minimum.value == function.value(minimum.theta)


def test_at_the_minimum_nothing_moves() -> None:
    minimum = found(quadratic(np.eye(2), np.array([1.0, 2.0])), [1.0, 2.0])
    assert minimum.iterations == 0


def test_update_is_skipped_where_the_curvature_is_negative() -> None:
    """From the top of a hill: the second step is that of the first inverse, and the valley is found."""
    function = Function(lambda t: t[0] ** 4 / 4 - t[0] ** 2 / 2, lambda t: t**3 - t)
    minimum = found(function, [0.1])
    first, second, third = function.visited[:3]
    gradient = second**3 - second
    assert third - second == pytest.approx(-gradient, rel=1e-12)
    assert second[0] - first[0] == pytest.approx(0.099, rel=1e-12)
    assert minimum.theta == pytest.approx([1.0], abs=1e-6)


def test_inverse_that_leads_uphill_moves_nothing() -> None:
    """An inverse Hessian that is not positive definite, to which a reset does not help either."""
    function = quadratic(np.eye(2), np.zeros(2))
    minimum = minimise(function, np.array([1.0, 1.0]), -np.eye(2), 100)
    np.testing.assert_array_equal(minimum.theta, [1.0, 1.0])


@pytest.mark.filterwarnings("ignore:invalid value")
def test_gradient_that_is_no_number_for_once_is_survived() -> None:
    """The third gradient is lost: the search ends there, at the lowest point so far."""
    exact = quadratic(np.diag([1.0, 25.0]), np.zeros(2))
    visited = 0

    def gradient(theta: Vector) -> Vector:
        nonlocal visited
        visited += 1
        return np.full(2, np.nan) if visited == 3 else exact.gradient(theta)

    function = Function(exact.value, gradient)
    minimum = found(function, [1.0, 1.0])
    assert minimum.iterations == 2
    assert minimum.value == function.value(function.visited[2]) < function.value(function.visited[1])


def test_gradient_that_is_no_number_is_not_convergence() -> None:
    function = Function(lambda t: float(t @ t), lambda t: np.full(2, np.nan))
    minimum = found(function, [1.0, 1.0])
    np.testing.assert_array_equal(minimum.theta, [1.0, 1.0])


def test_search_stays_where_the_cost_is_finite() -> None:
    """The minimum lies beyond the bound: the search ends inside, close to it, with a finite value."""

    def cost(theta: Vector) -> float:
        return math.inf if abs(theta[0]) > 1.0 else (theta[0] - 3.0) ** 2

    function = Function(cost, lambda t: 2 * (t - 3.0))
    minimum = found(function, [0.0], first=0.5)
    assert all(abs(theta[0]) <= 1.0 for theta in function.visited)
    assert 0.99 < minimum.theta[0] <= 1.0
    assert math.isfinite(minimum.value)


@given(st.integers(0, 10_000), st.floats(0.01, 100.0))
@example(4769, 48.0)  # a slope of 1e5 at the start
def test_every_step_goes_down(seed: int, first: float) -> None:
    """On random quartics, whatever the scale of the first inverse."""
    random = np.random.default_rng(seed)
    root, linear = random.normal(size=(3, 3)), random.normal(size=3)
    function = Function(
        lambda t: float(np.sum((root @ t) ** 4) + np.sum(t**2) + linear @ t),
        lambda t: 4 * root.T @ (root @ t) ** 3 + 2 * t + linear,
    )
    minimum = found(function, list(random.normal(size=3)), iterations=300, first=first)
    values = [function.value(theta) for theta in function.visited]
    assert all(after < before for before, after in pairwise(values))
    assert np.abs(4 * root.T @ (root @ minimum.theta) ** 3 + 2 * minimum.theta + linear).max() < 1e-4
