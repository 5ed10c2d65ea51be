"""Scalars that must pay for themselves: against a search written another way."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.engine.estimation.belief import ENTER, STAY, Belief, GatedBelief, best_subset
from observer_rt.engine.estimation.parameters import Alike, Gate
from tests.plants.arrays import Array

SIZE = 6
GATE = Gate({1: -0.5, 3: 0.0, 4: 0.0})
ALIKE_GATE = replace(GATE, alike=Alike(first=3, other=4, least=0.2))


def belief(seed: int, strength: float) -> tuple[Array, Array]:
    """Information (SIZE, SIZE) and vector of a random Gaussian belief."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(SIZE, SIZE))
    information = strength * (root @ root.T + 0.2 * np.eye(SIZE))
    return information, information @ random.normal(size=SIZE)


def subset_of(information: Array, vector: Array, active: frozenset[int]) -> tuple[Array, frozenset[int]]:
    covariance = np.asarray(np.linalg.inv(information), np.float64)
    return best_subset(covariance @ vector, covariance, GATE, active)


def searched(information: Array, vector: Array, active: frozenset[int]) -> tuple[Array, frozenset[int]]:
    """Every choice of on and off by least squares on a square root of the information."""
    square_root = np.linalg.cholesky(information).T
    target = np.linalg.solve(square_root.T, vector)
    best: tuple[float, Array, frozenset[int]] | None = None
    for switches in product([False, True], repeat=len(GATE.columns)):
        off = [c for c, on in zip(GATE.columns, switches, strict=True) if not on]
        used = [c for c in range(SIZE) if c not in off]
        theta = np.zeros(SIZE)
        theta[used] = np.linalg.lstsq(square_root[:, used], target, rcond=None)[0]
        lowest = zip(GATE.columns, GATE.lowest.values(), switches, strict=True)
        if any(on and theta[c] < low for c, low, on in lowest):
            continue
        chi2 = float(np.sum((square_root @ theta - target) ** 2))
        on = frozenset(c for c in GATE.columns if c not in off)
        cost = chi2 + STAY * len(on & active) + ENTER * len(on - active)
        if best is None or cost < best[0]:
            best = cost, theta, on
    assert best is not None  # all off is always possible
    return best[1], best[2]


@given(st.integers(0, 10_000), st.floats(-1.0, 2.0), st.frozensets(st.sampled_from(GATE.columns)))
def test_best_subset_is_the_best(seed: int, exponent: float, active: frozenset[int]) -> None:
    information, vector = belief(seed, 10.0**exponent)
    theta, chosen = subset_of(information, vector, active)
    expected, expected_chosen = searched(information, vector, active)
    assert chosen == expected_chosen
    np.testing.assert_allclose(theta, expected, atol=1e-8)
    left_out = [c for c in GATE.columns if c not in chosen]
    assert not theta[left_out].any()


def single(significance: float) -> tuple[Array, Array]:
    """Nothing known but column 3, which is `significance` of its standard deviations above 0."""
    information = np.eye(SIZE)
    vector = np.zeros(SIZE)
    vector[3] = significance
    return information, vector


@pytest.mark.parametrize(
    ("significance", "active", "chosen"),
    [(3.9, False, False), (4.1, False, True), (2.4, True, False), (2.6, True, True), (2.6, False, False)],
)
def test_four_sigma_to_enter_and_two_and_a_half_to_stay(significance: float, active: bool, chosen: bool) -> None:
    theta, after = subset_of(*single(significance), frozenset({3}) if active else frozenset[int]())
    assert (after == {3}) == chosen
    assert theta[3] == pytest.approx(significance if chosen else 0.0)


@pytest.mark.parametrize(
    ("size", "sigma", "active", "stays"),
    [(0.3, 0.5, True, True), (0.1, 0.05, True, False), (0.1, 0.03, True, True), (0.3, 0.5, False, False)],
)
def test_of_two_alike_the_first_stays_at_no_price_while_it_is_large(
    size: float, sigma: float, active: bool, stays: bool
) -> None:
    covariance, mean = sigma**2 * np.eye(SIZE), np.zeros(SIZE)
    mean[3] = size
    before = frozenset({3}) if active else frozenset[int]()
    assert best_subset(mean, covariance, ALIKE_GATE, before, carried=True)[1] == (before if stays else frozenset())


@pytest.mark.parametrize(("sigmas", "active", "enters"), [(7.0, {3}, False), (8.0, {3}, True), (5.0, set(), True)])
def test_of_two_alike_the_other_enters_at_a_high_price(sigmas: float, active: set[int], enters: bool) -> None:
    mean = np.zeros(SIZE)
    mean[[3, 4]] = 0.3, sigmas
    assert (4 in best_subset(mean, np.eye(SIZE), ALIKE_GATE, frozenset(active))[1]) is enters


def test_two_that_only_pay_together_are_found() -> None:
    """Alone each explains next to nothing: a search that adds one at a time would stop."""
    information = 1e4 * np.eye(SIZE)
    information[3, 4] = information[4, 3] = -0.99e4
    truth = np.zeros(SIZE)
    truth[[3, 4]] = 0.1
    theta, chosen = subset_of(information, information @ truth, frozenset())
    for alone in (3, 4):
        gain = (information @ truth)[alone] ** 2 / information[alone, alone]
        assert gain < ENTER
    assert chosen == frozenset()  # 0.1 is worth 2 here, the price is 32
    theta, chosen = subset_of(information, information @ (10 * truth), frozenset())
    assert chosen == {3, 4}
    np.testing.assert_allclose(theta, 10 * truth, atol=1e-9)


def test_singular_information_is_refused() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        subset_of(np.zeros((SIZE, SIZE)), np.zeros(SIZE), frozenset())


@given(st.integers(0, 10_000), st.floats(0.1, 1.0), st.frozensets(st.sampled_from(GATE.columns)))
def test_gated_covariance_is_that_of_the_error(seed: int, share: float, active: frozenset[int]) -> None:
    """By regression of the used on the known within the joint belief; its error is independent of the belief."""
    information, _ = belief(seed, 1.0)
    joint = np.asarray(np.linalg.inv(information), np.float64)
    error = np.asarray(share * np.linalg.inv(belief(seed + 1, 1.0)[0]), np.float64)
    inactive = [c for c in GATE.columns if c not in active]
    used = [c for c in range(SIZE) if c not in inactive]
    regression = np.zeros((SIZE, SIZE))
    regression[used, used] = 1.0
    if inactive:
        regression[np.ix_(used, inactive)] = -joint[np.ix_(used, inactive)] @ np.linalg.inv(
            joint[np.ix_(inactive, inactive)]
        )
    for covariance in (error, joint):
        np.testing.assert_allclose(
            GatedBelief(Belief(np.zeros(SIZE), joint, covariance), GATE, active).covariance,
            regression @ covariance @ regression.T,
            rtol=1e-6,
            atol=1e-6,
        )
