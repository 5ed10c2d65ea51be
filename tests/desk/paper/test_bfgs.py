"""The minimiser against scipy's BFGS, and what it does where the textbook's assumptions end."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.optimize import minimize, rosen, rosen_der

from observer_rt.desk.paper.scheme import SearchEnd, minimise
from observer_rt.foundation.units import Floats


class Function:
    """A cost with its gradient, which records the points at which the gradient was computed."""

    def __init__(self, cost: Callable[[Floats], float], gradient: Callable[[Floats], Floats]) -> None:
        self._cost = cost
        self._gradient = gradient
        self.visited: list[Floats] = []

    def value(self, theta: Floats) -> float:
        return float(self._cost(theta))

    def gradient(self, theta: Floats) -> Floats:
        self.visited.append(theta.copy())
        return np.asarray(self._gradient(theta), np.float64)


def minimum_of(function: Function, start: list[float], iterations: int = 500, first: float = 1.0) -> SearchEnd:
    return minimise(function, np.array(start), first * np.eye(len(start)), iterations)


def test_same_minimum_as_scipy() -> None:
    function, start = Function(rosen, rosen_der), [0.8, 1.3, 0.6, 1.1, 0.9]
    minimum = minimum_of(function, start)
    reference = minimize(function.value, start, jac=function.gradient, method="BFGS", options={"gtol": 1e-9})
    np.testing.assert_allclose(minimum.theta, reference.x, atol=2e-5)
    assert minimum.value == pytest.approx(reference.fun, abs=1e-10)
    assert minimum.value == function.value(minimum.theta)


def test_update_is_skipped_where_the_curvature_is_negative() -> None:
    """From the top of a hill: the second step still uses the first inverse, and the search ends in the valley."""
    function = Function(lambda t: t[0] ** 4 / 4 - t[0] ** 2 / 2, lambda t: t**3 - t)
    minimum = minimum_of(function, [0.1])
    first, second, third = function.visited[:3]
    gradient = second**3 - second
    assert third - second == pytest.approx(-gradient, rel=1e-12)
    assert second[0] - first[0] == pytest.approx(0.099, rel=1e-12)
    assert minimum.theta == pytest.approx([1.0], abs=1e-6)


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
    minimum = minimum_of(function, list(random.normal(size=3)), iterations=300, first=first)
    values = [function.value(theta) for theta in function.visited]
    assert all(after < before for before, after in pairwise(values))
    assert np.abs(4 * root.T @ (root @ minimum.theta) ** 3 + 2 * minimum.theta + linear).max() < 1e-4
