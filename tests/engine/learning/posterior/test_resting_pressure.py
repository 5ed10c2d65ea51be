"""What rest says of the gain of the line-pressure sensor over the rail's."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.engine.estimation.belief import Belief, prior_belief
from observer_rt.engine.estimation.scalars import SCALARS, Parameter, with_gain
from observer_rt.engine.learning.posterior.reader import SYSTEMATIC, RestingPressure

SCALE = 1e8  # Pa
OFFSET, GAIN = Parameter.LINE_PRESSURE_OFFSET, Parameter.LINE_PRESSURE_GAIN
SIGMA, TRUE_OFFSET, TRUE_GAIN = 0.0099, 0.002, 0.012


def wide(sigma: float = SIGMA) -> Belief:
    return prior_belief(np.zeros(SCALARS.width), np.diag(with_gain(SCALARS.prior(SCALE), sigma) ** 2))


def at_rest(pressures: NDArray[np.float64], excess: float = 0.0) -> RestingPressure:
    """Blocks at pressures [p_0] of sensors with the true offset and gain, a linearisation at 0."""
    slopes = -0.85 * np.column_stack((np.ones_like(pressures), pressures))
    means = -slopes @ [TRUE_OFFSET + excess, TRUE_GAIN]
    return RestingPressure(np.zeros(SCALARS.width), means, slopes, 1e-9, SCALE)


def taught(belief: Belief, *events: RestingPressure) -> Belief:
    for event in events:
        held = event.held(belief)
        information = event.slopes.T @ event.slopes / 1e-8
        complete = np.zeros((SCALARS.width, SCALARS.width))
        complete[np.ix_([OFFSET, GAIN], [OFFSET, GAIN])] = information
        vector = np.zeros(SCALARS.width)
        vector[[OFFSET, GAIN]] = -event.slopes.T @ event.means / 1e-8
        belief = held.considered(held.prior.updated(complete, vector), complete)
    return belief


def test_two_pressures_tell_the_gain_from_an_offset() -> None:
    first, second = (at_rest(np.full(7, pressure)) for pressure in (0.6, 1.2))
    after_one_event = taught(wide(), first)
    assert after_one_event.sigma[GAIN] > 0.9 * SIGMA
    both = taught(after_one_event, second)
    assert both.mean[[OFFSET, GAIN]] == pytest.approx([TRUE_OFFSET, TRUE_GAIN], abs=2e-4)
    assert both.sigma[GAIN] < 3e-4


@pytest.mark.parametrize("dip", [0.005, 0.02, 0.1])
def test_a_rail_that_dips_tells_no_more_than_its_recovery_allows(dip: float) -> None:
    belief = wide()
    for _ in range(50):
        belief = taught(belief, at_rest(np.linspace(1.0 - dip, 1.0, 7)))
    least = SYSTEMATIC / SCALE / (0.85 * dip)
    assert min(least, 0.9 * SIGMA) <= belief.sigma[GAIN] * (1.0 + 1e-6)
    assert abs(belief.mean[GAIN] - TRUE_GAIN) < 3.0 * belief.sigma[GAIN]


def test_a_sensor_that_is_another_says_nothing_of_the_gain() -> None:
    prior = taught(wide(), at_rest(np.full(7, 0.6)), at_rest(np.full(7, 1.2)))
    held = at_rest(np.full(7, 0.9), excess=0.02).held(prior)
    assert held.prior.mean[GAIN] == prior.mean[GAIN]
    assert held.variance == pytest.approx(prior.covariance[GAIN, GAIN])


def test_sensors_without_a_gain_are_learned_of_as_ever() -> None:
    belief = wide(0.0)
    assert at_rest(np.linspace(0.6, 1.2, 7)).held(belief).prior is belief
