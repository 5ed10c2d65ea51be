"""What is printed wrongly in the paper of its update (17), shown by numbers."""

import numpy as np
import pytest
from numpy.typing import NDArray


def printed_update(
    h: NDArray[np.float64], v: NDArray[np.float64], d: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(17) as printed, v the step and d the change of the gradient."""
    h_d = h @ d
    return h - np.outer(h_d, h_d) / (d @ h_d) + np.outer(v, v) / (d @ v)


@pytest.mark.parametrize("seed", range(5))
def test_equation_17_updates_the_inverse_and_not_the_hessian(seed: int) -> None:
    """H+ d = v, the secant condition of an inverse; a Hessian would have H+ v = d."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(4, 4))
    hessian = root @ root.T + np.eye(4)
    v = random.normal(size=4)
    d = hessian @ v
    updated = printed_update(2.0 * np.eye(4), v, d)
    np.testing.assert_allclose(updated @ d, v, atol=1e-10)
    assert np.linalg.norm(updated @ v - d) > 0.1 * np.linalg.norm(d)


def test_equation_17_is_davidon_fletcher_powell() -> None:
    """n exact line searches on a quadratic of n variables build the inverse Hessian, as DFP does."""
    random = np.random.default_rng(3)
    root = random.normal(size=(4, 4))
    hessian = root @ root.T + np.eye(4)
    inverse, theta = np.eye(4), random.normal(size=4)
    for _ in range(4):
        gradient = hessian @ theta
        direction = -inverse @ gradient
        v = -(gradient @ direction) / (direction @ hessian @ direction) * direction
        theta = theta + v
        inverse = printed_update(inverse, v, hessian @ v)
    np.testing.assert_allclose(inverse @ hessian, np.eye(4), atol=1e-8)
    np.testing.assert_allclose(theta, 0.0, atol=1e-8)


def test_equations_16_and_17_as_printed_lead_astray() -> None:
    """Dividing by H of (17) turns the curvature upside down: fifty iterations do not reach the minimum."""
    hessian = np.diag([1.0, 100.0])
    h, theta = np.eye(2), np.array([1.0, 1.0])
    start = 0.5 * theta @ hessian @ theta
    for _ in range(50):
        gradient = hessian @ theta
        direction = -np.linalg.solve(h, gradient)
        step = 1.0
        value = 0.5 * theta @ hessian @ theta
        for _ in range(60):
            trial = theta + step * direction
            if 0.5 * trial @ hessian @ trial < value + 1e-4 * step * gradient @ direction:
                break
            step *= 0.5
        v = step * direction
        if not v @ hessian @ v > 0.0:
            break
        h = printed_update(h, v, hessian @ v)
        theta = theta + v
    assert 0.5 * theta @ hessian @ theta > 1e-6 * start
