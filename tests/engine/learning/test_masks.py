"""Stretches of a line pressure that are held, clipped or loud, and those that only look like them."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from observer_rt.core.learning.outliers import LENGTH, PRICE, find_held, find_loud
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.noise import CleanWindow, Sigmas, without_stretches
from tests.plants.arrays import Array

NOISE = 0.0015  # of p_0
SIGMAS = Sigmas(innovation=1.2 * NOISE, noise=NOISE)
COUNT, OPENING, FIRST = 1500, 100, 50
BURST = slice(500, 700)


def truth() -> Array:
    """A line that swings after an injection, over the rail pressure and below it."""
    k = np.arange(COUNT) - OPENING
    return 1.0 + np.where(k > 0, -0.15 * np.sin(2.0 * np.pi * k / 130.0) * np.exp(-k / 600.0), 0.0)


def noise(seed: int, burst: float = 0.0, at: slice = BURST) -> Array:
    sigmas = np.full(COUNT, NOISE)
    sigmas[at] = np.hypot(NOISE, burst)
    return np.asarray(np.random.default_rng(seed).normal(size=COUNT) * sigmas, np.float64)


def without(y: Array, innovations: Array | None = None) -> CleanWindow | None:
    resting = np.arange(COUNT) > COUNT // 2
    window = Window(np.column_stack([np.ones(COUNT), np.zeros(COUNT)]), y, resting, np.zeros(4), OPENING)
    return without_stretches(window, y - truth() if innovations is None else innovations, SIGMAS, FIRST)


def spans(masked: CleanWindow | None) -> list[tuple[int, int]]:
    if masked is None:
        return []
    edges = np.flatnonzero(np.diff(np.concatenate(([0], masked.window.masked.astype(np.int8), [0]))))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


@pytest.mark.parametrize(
    "held", [[(300, 320)], [(150, 200), (500, 550)], [(180, 205), (260, 285), (340, 365), (420, 445)]]
)
def test_what_is_held_ahead_of_the_noise_is_found(held: list[tuple[int, int]]) -> None:
    y = truth()
    for start, end in held:
        y[start:end] = y[start]
    stretches = spans(without(y + noise(1)))
    assert len(stretches) == len(held)
    for (start, end), (first, last) in zip(held, stretches, strict=True):
        assert start - 6 <= first <= start + 8  # it begins as the truth does
        assert abs(last - end) <= 2


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_what_lies_beyond_an_end_of_the_range_is_found(sign: float) -> None:
    limit = 1.0 + sign * 0.08
    is_beyond = sign * truth() > sign * limit
    masked = without(np.where(is_beyond, limit, truth()) + noise(2))
    assert masked is not None
    assert masked.window.masked[is_beyond].all()
    assert np.count_nonzero(masked.window.masked & ~is_beyond) < 0.3 * np.count_nonzero(is_beyond)


@pytest.mark.parametrize("burst", [3.0, 10.0])
def test_a_burst_is_found_to_a_few_samples(burst: float) -> None:
    for seed in range(10):
        ((start, end),) = spans(without(truth() + noise(seed, burst * NOISE)))
        assert abs(start - BURST.start) < LENGTH // 2
        assert abs(end - BURST.stop) < LENGTH // 2


def test_noise_at_its_level_has_no_stretch() -> None:
    for seed in range(50):
        assert without(truth() + noise(seed)) is None


def test_neither_a_spike_nor_a_step_is_a_stretch() -> None:
    y = truth() + noise(1)
    y[300] += 100.0 * NOISE
    y[900:] += 100.0 * NOISE
    assert without(y, noise(1)) is None


def test_noise_that_is_louder_all_the_time_is_no_stretch() -> None:
    for seed in range(20):
        louder = 5.0 * np.convolve(noise(seed), np.ones(4), "same")
        assert sum(end - start for start, end in spans(without(truth() + louder, louder))) < 0.03 * COUNT
    assert without(truth() + noise(2, 5.0 * NOISE, slice(0, COUNT))) is None


def test_what_is_masked_already_is_in_no_stretch() -> None:
    y = truth()
    y[300:320] = y[300]
    first = without(y + noise(1))
    assert first is not None
    innovations = np.where(first.window.masked, 0.0, y + noise(1) - truth())
    assert without_stretches(first.window, innovations, SIGMAS, FIRST) is None


def test_a_wrong_model_of_what_moves_is_no_stretch() -> None:
    assert without(truth() + noise(3), noise(3) + 0.2 * (truth() - 1.0)) is None


def chi2_of_constant(y: Array) -> float:
    return float(np.sum((y - y.mean()) ** 2))


@given(arrays(np.float64, 24, elements=st.floats(-4.0, 4.0)), arrays(np.float64, 24, elements=st.floats(-9.0, 9.0)))
def test_held_stretches_are_the_best_of_all_ways_to_part_an_event(y: Array, deviates: Array) -> None:
    """Against plain recursion over the ends of the last stretch."""
    n, best = y.size, np.zeros(y.size + 1)
    for end in range(1, n + 1):
        best[end] = best[end - 1]
        for start in range(end - 7):
            half = 0.5 * chi2_of_constant(y[start:end])
            if half < 0.5 * (end - start) + 4.0 * np.sqrt(0.5 * (end - start)):
                best[end] = max(best[end], best[start] + 0.5 * chi2_of_constant(deviates[start:end]) - half - PRICE)
    stretches = find_held(y, deviates, np.zeros(n, np.bool_), 1.0, 0)
    worth = sum(0.5 * chi2_of_constant(deviates[int(a) : int(b)]) - nats for a, b, nats in stretches)
    assert worth == pytest.approx(best[n], abs=1e-9)
    assert all(earlier[1] <= later[0] for later, earlier in pairwise(stretches))


def test_a_loud_stretch_costs_what_its_loudness_says() -> None:
    (start, end, nats) = find_loud(truth() + noise(4, 3.0 * NOISE), NOISE)[0]
    assert nats == pytest.approx(PRICE + 0.5 * (end - start) * (1.0 + np.log(7.0)), rel=0.15)
