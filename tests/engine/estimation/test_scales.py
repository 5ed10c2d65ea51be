"""Weights of the network are as large as what was seen says, curve by curve, and an unseen one varies by that."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.engine.estimation import scales
from observer_rt.engine.estimation.belief import Belief, prior_belief
from observer_rt.engine.estimation.parameters import SCALARS, WEIGHTS
from observer_rt.model.network import IS_PAIR, NEURONS

PRIOR = SCALARS.prior(1.0)
CURVES = np.repeat(np.arange(NEURONS.size), NEURONS)
PAIRS, SINGLE = np.flatnonzero(IS_PAIR), np.flatnonzero(~IS_PAIR)
OF_NOZZLE = 4  # curves along one input
MEASUREMENTS = 30
SQUARES = np.full((3**SINGLE.size, NEURONS.size), scales.NONE**2)
SQUARES[:, SINGLE] = [*itertools.product((scales.NONE**2, scales.SMALL**2, 0.999), repeat=SINGLE.size)]
"""Of the scales of the curves, in every choice of them, with no pair in use."""


def with_pairs(squares: NDArray[np.float64], pairs: frozenset[int]) -> NDArray[np.float64]:
    """The squares (..., curves) where these pairs are in use."""
    return np.where(np.isin(np.arange(NEURONS.size), list(pairs)), 1.0 - 1e-9, squares)


def prior_logs() -> NDArray[np.float64]:
    """Of the choices: a flow has no law, or one in which all curves have one scale, or one with any scales."""
    flows = list[NDArray[np.float64]]()
    for curves in (OF_NOZZLE, SINGLE.size - OF_NOZZLE):
        choices = [*itertools.product(range(3), repeat=curves)]
        any_scales = (1.0 - scales.LAWLESS) * (1.0 - scales.ONE_SCALE) / (len(choices) - 1)
        weights = dict.fromkeys(choices, any_scales)
        weights[(0,) * curves] = scales.LAWLESS
        for scale in (1, 2):
            weights[(scale,) * curves] += (1.0 - scales.LAWLESS) * scales.ONE_SCALE / 2
        assert sum(weights.values()) == pytest.approx(1.0)
        flows.append(np.array([*weights.values()]))
    return np.asarray(np.log(np.outer(flows[0], flows[1]).ravel()))


def scaled(squares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Variances of the prior whose weights' variances are these shares of the whole one, by curve."""
    variances = PRIOR**2
    variances[WEIGHTS] *= squares[CURVES]
    return variances


def measured(scales: tuple[float, ...], seed: int = 3) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Measurements (n, m) with noise of 1, of weights that are these shares of the prior, and their values (n,)."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(MEASUREMENTS, PRIOR.size)) / PRIOR
    rows[:, WEIGHTS[::5]] = 0.0  # some are not excited
    theta = np.sqrt(scaled(np.square(scales))) * rng.normal(size=PRIOR.size)
    return rows, rows @ theta + rng.normal(size=MEASUREMENTS)


def learned(variances: NDArray[np.float64], rows: NDArray[np.float64], seen: NDArray[np.float64]) -> Belief:
    return prior_belief(np.zeros(PRIOR.size), np.diag(variances)).updated(rows.T @ rows, rows.T @ seen)


def likelihood(rows: NDArray[np.float64], seen: NDArray[np.float64], squares: NDArray[np.float64]) -> float:
    """Logarithm of the marginal likelihood of the measurements themselves."""
    spread = (rows * scaled(squares)) @ rows.T + np.eye(MEASUREMENTS)
    return -0.5 * float(np.linalg.slogdet(spread)[1] + seen @ np.linalg.solve(spread, seen))


def tried(rows: NDArray[np.float64], seen: NDArray[np.float64]) -> dict[frozenset[int], NDArray[np.float64]]:
    """Logarithms of all choices with the pairs that pay, one after another."""
    pairs, result = frozenset[int](), dict[frozenset[int], NDArray[np.float64]]()
    while True:
        every = with_pairs(SQUARES, pairs)
        logs = prior_logs() + [likelihood(rows, seen, squares) for squares in every]
        logs += len(pairs) * math.log(scales.PAIRED)
        result[pairs], best = logs, every[int(np.argmax(logs))]
        before = likelihood(rows, seen, best) - math.log(scales.PAIRED)
        more = {frozenset({*pairs, pair}): with_pairs(best, frozenset({pair})) for pair in PAIRS.tolist()}
        gains = {choice: likelihood(rows, seen, more[choice]) - before for choice in more.keys() - {pairs}}
        furthest = max(gains, key=lambda choice: gains[choice])
        if gains[furthest] < 0.0 or len(pairs) == scales.MOST_PAIRS:
            return result
        pairs = furthest


SCALES = {
    "none": (0.0,) * 13,
    "nozzle": (2.0,) * 4 + (0.0,) * 9,
    "one": (0.0, 0.0, 3.0) + (0.0,) * 7 + (0.05, 0.05, 0.0),
    "seat": (0.05,) * 4 + (0.0,) * 6 + (2.0, 0.0, 0.0),
    "pair": (1.0,) * 4 + (0.0, 0.0, 6.0) + (0.0,) * 6,
}


@pytest.mark.parametrize("name", SCALES)
def test_the_scale_of_each_curve_is_what_its_marginal_likelihood_says(name: str) -> None:
    rows, seen = measured(SCALES[name])
    sets = tried(rows, seen)
    weights = np.exp(np.array([*sets.values()]) - np.max([*sets.values()]))
    weights /= weights.sum()
    lawful = weights.sum(axis=0) @ (SQUARES > scales.NONE**2)
    for pairs, weight in zip(sets, weights.sum(axis=1), strict=True):
        lawful[list(pairs)] += weight
    assert any(sets) is (name == "pair")
    np.testing.assert_allclose(scales.law_probabilities(learned(PRIOR**2, rows, seen)), lawful, atol=2e-5)


@pytest.mark.parametrize("pairs", [frozenset(), frozenset({6, 12})], ids=["none", "two"])
def test_an_event_is_weighed_as_if_pairs_out_of_use_had_hardly_any_weights(pairs: frozenset[int]) -> None:
    rows, seen = measured(SCALES["pair"])
    belief = scales.without_others(learned(PRIOR**2, rows, seen), pairs)
    expected = learned(scaled(with_pairs(np.where(IS_PAIR, scales.NONE**2, 1.0), pairs)), rows, seen)
    spread = np.outer(PRIOR, PRIOR)
    np.testing.assert_allclose(belief.mean / PRIOR, expected.mean / PRIOR, atol=2e-3)
    np.testing.assert_allclose(belief.covariance / spread, expected.covariance / spread, atol=1e-3)
    in_use = belief.part(scales.columns_in_use(pairs))
    logs, _ = scales.weigh_choices(in_use.mean, in_use.covariance, pairs)
    every = prior_logs() + [likelihood(rows, seen, squares) for squares in with_pairs(SQUARES, pairs)]
    np.testing.assert_allclose(logs - logs.max(), every - every.max(), atol=2e-2)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.02, 2.0), st.floats(0.02, 2.0))
def test_a_belief_whose_error_is_another_is_as_if_weights_were_measured_to_be_0(
    seed: int, nozzle: float, seat: float
) -> None:
    """With as much noise as makes a smaller prior of the whole one, whose scales are as likely as that is."""
    belief = learned(PRIOR**2, *measured((nozzle,) * 4 + (0.0,) * 6 + (seat, seat, 0.0), seed)).drifted(0.1 * PRIOR)
    assume(not scales.law_probabilities(belief)[PAIRS].any())
    rows, prior, covariance = np.eye(PRIOR.size)[WEIGHTS], PRIOR[WEIGHTS] ** 2, belief.covariance
    noises = [np.diag(prior * squares[CURVES] / (1.0 - squares[CURVES])) for squares in SQUARES]
    seen, logs = rows @ belief.mean, prior_logs() - 0.5 * np.log1p(-SQUARES[:, CURVES]).sum(axis=1)
    for number, noise in enumerate(noises):
        spread = rows @ covariance @ rows.T + noise
        logs[number] -= 0.5 * (np.linalg.slogdet(spread)[1] + seen @ np.linalg.solve(spread, seen))
    weights = np.exp(logs - logs.max()) / np.exp(logs - logs.max()).sum()
    order = np.argsort(-weights)[: scales.CHOICES]
    order = order[: np.searchsorted(np.cumsum(weights[order]), scales.CHOSEN) + 1]
    shares, means, covariances, errors = weights[order] / weights[order].sum(), [], [], []
    for noise in (noises[choice] for choice in order):
        gain = covariance @ rows.T @ np.linalg.inv(rows @ covariance @ rows.T + noise)
        kept = np.eye(PRIOR.size) - gain @ rows
        means.append(kept @ belief.mean)
        errors.append(kept @ belief.error_covariance @ kept.T + gain @ noise @ gain.T)
        covariances.append(kept @ covariance)
    mean, small, scale = shares @ np.array(means), scales.shrink(belief), np.outer(PRIOR, PRIOR)
    between = np.cov(np.array(means).T, aweights=shares, ddof=0) if len(means) > 1 else 0.0
    unused = WEIGHTS[IS_PAIR[CURVES]]
    used = np.delete(np.arange(PRIOR.size), unused)
    assert not small.mean[unused].any()  # or a sample would follow their curves
    np.testing.assert_allclose(small.mean[used], mean[used], rtol=1e-6, atol=1e-6 * PRIOR.min())
    for result, parts in ((small.covariance, covariances), (small.error_covariance, errors)):
        away = (result - np.tensordot(shares, parts, 1) - between) / scale
        np.testing.assert_allclose(away[np.ix_(used, used)], 0.0, atol=1e-7)
