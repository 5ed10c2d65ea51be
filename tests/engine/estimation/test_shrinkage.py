"""Weights of the network are as large as what was seen says, and an unseen one varies by that."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.engine.estimation.gating import Belief, prior_belief
from observer_rt.engine.estimation.scalars import SCALARS, WEIGHTS
from observer_rt.engine.learning.learned_injector import NONE, SMALL, shrink
from observer_rt.model.network import OF_NOZZLE

PRIOR = SCALARS.prior(1.0)
FLOWS = np.repeat((0, 1), (OF_NOZZLE, WEIGHTS.size - OF_NOZZLE))
MEASUREMENTS = 30


def scaled(squares: tuple[float, ...]) -> NDArray[np.float64]:
    """Variances of the prior with weights of nozzle and seat whose variances are these shares."""
    variances = PRIOR**2
    variances[WEIGHTS] *= np.array(squares)[FLOWS]
    return variances


def measured(nozzle: float, seat: float, seed: int = 3) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Measurements (n, m) with noise of 1, of weights that are these shares of the prior, and their values (n,)."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(MEASUREMENTS, PRIOR.size)) / PRIOR
    rows[:, WEIGHTS[::5]] = 0.0  # some are not excited
    theta = np.sqrt(scaled((nozzle**2, seat**2))) * rng.normal(size=PRIOR.size)
    return rows, rows @ theta + rng.normal(size=MEASUREMENTS)


def learned(variances: NDArray[np.float64], rows: NDArray[np.float64], seen: NDArray[np.float64]) -> Belief:
    return prior_belief(np.zeros(PRIOR.size), np.diag(variances)).updated(rows.T @ rows, rows.T @ seen)


def likelihood(variances: NDArray[np.float64], rows: NDArray[np.float64], seen: NDArray[np.float64]) -> float:
    spread = (rows * variances) @ rows.T + np.eye(MEASUREMENTS)
    return -0.5 * float(np.linalg.slogdet(spread)[1] + seen @ np.linalg.solve(spread, seen))


@pytest.mark.parametrize(("nozzle", "seat"), [(0.0, 0.0), (0.05, 0.05), (1.0, 0.05), (0.05, 1.0), (2.0, 1.5)])
def test_the_scale_of_each_flow_is_what_its_marginal_likelihood_says(nozzle: float, seat: float) -> None:
    """Against the likelihood of the measurements themselves, and a prior that has that scale from the start."""
    rows, seen = measured(nozzle, seat)
    scales = list(itertools.product((NONE**2, SMALL**2, 1.0), repeat=2))
    logs = np.array([likelihood(scaled(each), rows, seen) for each in scales])
    weights = np.exp(logs - logs.max()) / np.exp(logs - logs.max()).sum()
    of_nozzle, of_seat = weights @ np.array(scales)
    expected = learned(scaled((of_nozzle, of_seat)), rows, seen)
    small = shrink(learned(PRIOR**2, rows, seen))
    np.testing.assert_allclose(small.sigma, expected.sigma, rtol=0.01)
    np.testing.assert_allclose(small.mean, expected.mean, atol=0.05 * expected.sigma.max(), rtol=0.02)
    np.testing.assert_allclose(small.error_covariance, small.covariance, atol=1e-9)
    unseen = small.sigma[WEIGHTS[::5]] / PRIOR[WEIGHTS[::5]]
    assert unseen[0] == pytest.approx(np.sqrt(of_nozzle), rel=0.01)
    assert unseen[-1] == pytest.approx(np.sqrt(of_seat), rel=0.01)


@settings(max_examples=30)
@given(st.integers(0, 10_000), st.floats(0.02, 2.0), st.floats(0.02, 2.0))
def test_it_is_as_if_weights_were_measured_to_be_0(seed: int, nozzle: float, seat: float) -> None:
    """With as much noise as makes a smaller prior of the whole one, whose scales are as likely as that is."""
    belief = learned(PRIOR**2, *measured(nozzle, seat, seed)).drifted(0.1 * PRIOR)  # whose error is another
    squares = np.array([*itertools.product((NONE**2, SMALL**2, 0.999), repeat=2)])[:, FLOWS]
    rows, prior, covariance = np.eye(PRIOR.size)[WEIGHTS], PRIOR[WEIGHTS] ** 2, belief.covariance
    spreads = [rows @ covariance @ rows.T + np.diag(prior * each / (1.0 - each)) for each in squares]
    seen = rows @ belief.mean
    logs = [-0.5 * (np.linalg.slogdet(each)[1] + seen @ np.linalg.solve(each, seen)) for each in spreads]
    weights = np.exp(logs - 0.5 * np.log1p(-squares).sum(axis=1) - np.max(logs))
    mixed = weights @ squares / weights.sum()
    noise = np.diag(prior * mixed / (1.0 - mixed))
    gain = covariance @ rows.T @ np.linalg.inv(rows @ covariance @ rows.T + noise)
    kept, small = np.eye(PRIOR.size) - gain @ rows, shrink(belief)
    np.testing.assert_allclose(small.mean, kept @ belief.mean, rtol=1e-9, atol=1e-9 * PRIOR.min())
    error = kept @ belief.error_covariance @ kept.T + gain @ noise @ gain.T
    for result, expected in ((small.covariance, kept @ covariance), (small.error_covariance, error)):
        np.testing.assert_allclose(result / np.outer(PRIOR, PRIOR), expected / np.outer(PRIOR, PRIOR), atol=1e-9)
