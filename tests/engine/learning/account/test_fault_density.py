"""Densities of innovations that are white, nearly white, and none of either."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.engine.estimation.phases import PHASES, Phase, phase_statistics
from observer_rt.engine.learning.account.evidence import at_fault, nearly_white
from observer_rt.engine.learning.adequacy import CLIP
from observer_rt.engine.learning.healthy import NOT_FITTED

PHASE_SAMPLES = {
    Phase.STANDSTILL: 500,
    Phase.OPENING: 30,
    Phase.OPEN: 150,
    Phase.CLOSING: 30,
    Phase.AFTER: 200,
}
PHASE_OF = np.repeat(np.arange(PHASES, dtype=np.int8), [PHASE_SAMPLES[phase] for phase in Phase])
SEEDS = range(40)


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
