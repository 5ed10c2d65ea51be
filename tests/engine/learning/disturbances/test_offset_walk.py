"""By how much an event's standstill contradicts the offset it was linearised at."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from observer_rt.engine.estimation.gating import prior_belief
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.estimation.scalars import Parameter
from observer_rt.engine.learning.disturbances.pressure_gains import moved, offset_move

SAMPLES, WIDTH, BURN_IN = 1200, 18, 50
SIGMA = 0.0015  # of an innovation, in units of p_0
SHARE = -0.4  # of an offset that innovations keep


def window(masked: tuple[int, ...] = ()) -> Window:
    resting = np.ones(SAMPLES, np.bool_)
    resting[100:500] = False
    mask = np.zeros(SAMPLES, np.bool_)
    mask[list(masked)] = True
    nothing = np.zeros(SAMPLES)
    return Window(np.zeros((SAMPLES, 2)), nothing, resting, np.zeros(4), 100, masked=mask)


def cost(move: float) -> Any:
    """Of an event during which the offset was larger by `move`."""
    noise = np.random.default_rng(4).normal(0.0, SIGMA, SAMPLES)
    slopes = np.zeros((SAMPLES, WIDTH))
    slopes[:, Parameter.LINE_PRESSURE_OFFSET] = SHARE
    innovations = noise - SHARE * move
    innovations[100:500] += 0.1  # what the injection does is no offset
    innovations[:BURN_IN] += 0.1
    return SimpleNamespace(innovations=innovations, slopes=slopes, sigma=SIGMA, burn_in=BURN_IN)


@pytest.mark.parametrize("move", [0.005, -0.002, 0.001])
def test_a_move_is_found(move: float) -> None:
    assert offset_move(window(), cost(move)) == pytest.approx(move, abs=4e-4)


@pytest.mark.parametrize("move", [0.0, 2e-4])
def test_noise_is_no_move(move: float) -> None:
    assert offset_move(window(), cost(move)) == 0.0


def test_outliers_are_no_move() -> None:
    disturbed = cost(0.0)
    disturbed.innovations[600:640] += 0.1
    assert offset_move(window(tuple(range(600, 640))), disturbed) == 0.0
    assert offset_move(window(), disturbed) != 0.0


def test_a_belief_moves_and_is_less_sure_by_as_much() -> None:
    belief = prior_belief(np.zeros(WIDTH), 1e-8 * np.eye(WIDTH))
    after = moved(belief, 0.003)
    others = np.arange(WIDTH) != Parameter.LINE_PRESSURE_OFFSET
    assert after.mean[Parameter.LINE_PRESSURE_OFFSET] == 0.003
    assert after.sigma[Parameter.LINE_PRESSURE_OFFSET] == pytest.approx(0.003, rel=0.01)
    assert not after.mean[others].any()
    assert after.sigma[others] == pytest.approx(belief.sigma[others])
