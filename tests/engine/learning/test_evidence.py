"""Evidence of an event for a prior, and densities of its innovations."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.engine.estimation.belief import Belief, prior_belief
from observer_rt.engine.estimation.phases import PHASES, Phase, phase_statistics
from observer_rt.engine.learning.adequacy import CLIP
from observer_rt.engine.learning.fit import BEYOND, Limits, at_fault, evidence_of, nearly_white
from observer_rt.engine.learning.healthy import NOT_FITTED
from observer_rt.engine.learning.run import EventRun

FAR = np.full(2, 1e3)
ANYWHERE, BOTH = Limits(-FAR, FAR, FAR), np.arange(2)

PHASE_SAMPLES = {Phase.STANDSTILL: 500, Phase.OPENING: 30, Phase.OPEN: 150, Phase.CLOSING: 30, Phase.AFTER: 200}
PHASE_OF = np.repeat(np.arange(PHASES, dtype=np.int8), [PHASE_SAMPLES[phase] for phase in Phase])
SEEDS = range(40)


def parabola(entries: list[float]) -> EventRun:
    root = np.array([[entries[0], 0.0], [entries[1], entries[2]]])
    return EventRun(np.array(entries[3:5]), 1.0, np.array(entries[5:7]), root @ root.T + 0.1 * np.eye(2))


def prior(mean: list[float], sigma: list[float], correlation: float) -> Belief:
    return prior_belief(np.array(mean), np.outer(sigma, sigma) * np.array([[1.0, correlation], [correlation, 1.0]]))


def integral(cost: EventRun, belief: Belief) -> tuple[float, NDArray[np.float64]]:
    """Logarithm of the integral of exp(-cost) over a prior, and the mean of theta after it, on a grid."""
    grid = np.linspace(-12.0, 12.0, 601)
    theta = np.stack(np.meshgrid(grid, grid, indexing="ij"), axis=-1).reshape(-1, 2)
    away, step = theta - belief.mean, theta - cost.theta
    logs = -0.5 * np.einsum("ki,ij,kj->k", away, belief.information, away) - cost.value - step @ cost.gradient
    logs -= 0.5 * np.einsum("ki,ij,kj->k", step, cost.information, step)
    weights = np.exp(logs - logs.max())
    complete = math.log(weights.sum() * (grid[1] - grid[0]) ** 2) + float(logs.max())
    norm = math.log(2.0 * math.pi) + 0.5 * math.log(float(np.linalg.det(belief.covariance)))
    return complete - norm, weights @ theta / weights.sum()


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(-2.0, 2.0), min_size=7, max_size=7),
    st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=2),
    st.lists(st.floats(0.4, 1.5), min_size=2, max_size=2),
    st.floats(-0.7, 0.7),
)
def test_it_is_the_integral(entries: list[float], mean: list[float], sigma: list[float], correlation: float) -> None:
    cost, belief = parabola(entries), prior(mean, sigma, correlation)
    result, (log, theta) = evidence_of(cost, belief, ANYWHERE, BOTH), integral(cost, belief)
    assert result.log == pytest.approx(log, abs=1e-3)
    np.testing.assert_allclose(result.theta, theta, atol=1e-3)


@pytest.mark.parametrize(
    "limits",
    [Limits(np.array([-1.0, -1.0]), np.array([0.5, 1.0]), FAR), Limits(-FAR, FAR, np.array([0.1, 0.1]))],
    ids=["a limit", "slopes that do not hold"],
)
def test_of_what_lies_beyond_little_is_believed(limits: Limits) -> None:
    cost = EventRun(np.zeros(2), 50.0, np.array([-40.0, 0.0]), 20.0 * np.eye(2))
    belief = prior([0.0, 0.0], [1.0, 1.0], 0.0)
    result, free = evidence_of(cost, belief, limits, BOTH), evidence_of(cost, belief, ANYWHERE, BOTH)
    reached = np.clip(free.theta / max(1.0, float(np.max(free.theta / limits.longest_step))), None, limits.highest)
    total = cost.expected(reached) + 0.5 * float(reached @ reached)
    price = free.log + cost.expected(free.theta) + 0.5 * float(free.theta @ free.theta)
    assert result.log == pytest.approx(price - total + BEYOND, rel=1e-6)
    assert result.log < free.log


def white(seed: int) -> NDArray[np.float64]:
    return np.random.default_rng(seed).normal(size=PHASE_OF.size)


def tolerated(innovations: NDArray[np.float64]) -> float:
    return nearly_white(phase_statistics(innovations, 1.0, PHASE_OF, 0, None, CLIP), 1.0, NOT_FITTED)


def against_fault(innovations: NDArray[np.float64]) -> float:
    """Nats by which noise explains them better than a fault does."""
    broad = at_fault(phase_statistics(innovations, 1.0, PHASE_OF, 0), 1.0)
    return broad - 0.5 * float(innovations @ innovations) + tolerated(innovations)


def test_white_innovations_are_of_no_fault() -> None:
    result = [against_fault(white(seed)) for seed in SEEDS]
    assert np.median(result) > 3.0
    assert np.mean(np.array(result) < 0.0) < 0.05


@pytest.mark.parametrize("phase", [Phase.OPEN, Phase.AFTER])
def test_a_phase_that_swings_is_at_fault(phase: Phase) -> None:
    swing = 1.5 * np.sin(np.arange(PHASE_OF.size) / 8.0) * (phase == PHASE_OF)
    result = [against_fault(white(seed) + swing) for seed in SEEDS]
    assert max(result) < -10.0


def test_a_little_too_loud_is_nearly_white() -> None:
    result = [against_fault(math.sqrt(1.1) * white(seed)) for seed in SEEDS]
    assert np.median(result) > 2.0


def test_one_outlier_is_no_tolerance() -> None:
    """It is clipped there: a spike does not make the rest of an event nearly white."""
    spiked = white(1)
    spiked[600] = 40.0
    assert tolerated(spiked) < tolerated(white(1)) + 8.0
    assert against_fault(spiked) < -100.0
