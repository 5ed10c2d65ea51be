"""What is printed wrongly in the paper, shown by numbers: the sign of (5), the update (17)."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.estimation.scalars import PARAMETERS
from tests.estimation.conftest import SAMPLE_RATE, Case, event_inputs, innovations_at, simulated_event

HEALTHY = np.zeros(PARAMETERS)


def identification_errors(case: Case, gain: float) -> NDArray[np.float64]:
    """|y - C x~| of (5) with l = |gain| 1/s on p_L alone, from an initial error of 1 MPa."""
    window = simulated_event(case, HEALTHY, event_inputs(samples=1000))
    window.start[[0, 3]] += 0.01
    per_sample = gain / SAMPLE_RATE
    paper = replace(case, setting=case.setting._replace(gain=np.array([per_sample, 0.0, per_sample])))
    return np.abs(innovations_at(paper, window, HEALTHY))


@pytest.mark.parametrize("gain", [1e4, 3e4])
def test_minus_of_equation_5_diverges_and_plus_converges(case: Case, gain: float) -> None:
    plus, minus = identification_errors(case, gain), identification_errors(case, -gain)
    assert plus[-100:].max() < 1e-6  # of p_0: the initial error is forgotten
    assert not (minus[-100:] < 1.0).any()  # p_0 and more, whatever the rail says
    assert np.nanmax(minus[: round(10 * SAMPLE_RATE / gain)]) > 10 * minus[1]  # within ten time constants


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
