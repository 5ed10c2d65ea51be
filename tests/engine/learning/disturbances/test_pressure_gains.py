"""Gains of the pressure sensors, told by offsets over pressures."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.engine.estimation.gating import prior_belief
from observer_rt.engine.estimation.scalars import Parameter
from observer_rt.engine.learning.disturbances.pressure_gains import LARGEST_GAIN, PressureGains

PRESSURES = (0.6, 1.0, 1.4, 0.8, 1.2)  # p_0
WIDTH = 18


def after(offset: float, gain: float, events: int = 10, noise: float = 0.0) -> PressureGains:
    gains, random = PressureGains(), np.random.default_rng(3)
    for k in range(events):
        pressure = PRESSURES[k % len(PRESSURES)]
        gains = gains.after(offset + gain * pressure + noise * random.normal(), pressure)
    return gains


@pytest.mark.parametrize("gain", [0.005, -0.01])
@pytest.mark.parametrize("offset", [0.0, 0.01])
def test_a_gain_is_found_beside_an_offset(offset: float, gain: float) -> None:
    assert after(offset, gain, noise=2e-4).difference == pytest.approx(gain, abs=1e-3)


def test_an_offset_alone_is_no_gain() -> None:
    assert after(0.015, 0.0, events=30, noise=2e-4).difference == 0.0


def test_five_events_are_needed() -> None:
    assert after(0.0, 0.01, events=4).difference == 0.0
    assert after(0.0, 0.01, events=5).difference == pytest.approx(0.01)


def test_at_one_pressure_nothing_is_told_of_gains() -> None:
    """A rail sensor that drifts moves its own reading and, the other way, what the line is over it."""
    gains = PressureGains()
    for drift in np.linspace(0.0, 0.01, 20):
        gains = gains.after(-float(drift), 1.0 + float(drift))
    assert gains.difference == 0.0


def test_a_drift_is_no_gain() -> None:
    gains, random = PressureGains(), np.random.default_rng(5)
    for k in range(60):
        gains = gains.after(0.01 * np.sin(0.15 * k), float(random.uniform(0.4, 1.6)))
        assert abs(gains.difference) < LARGEST_GAIN


@given(st.floats(-0.015, 0.015), st.floats(0.3, 1.8))
def test_half_of_it_is_undone(gain: float, pressure: float) -> None:
    gains = after(0.0, gain)
    line = np.array([(1.0 + gain) * pressure])
    left = float(gains.undone(line)[0]) - pressure
    assert (
        left == pytest.approx(0.5 * gains.difference * pressure, abs=1.5e-4 * pressure)
        or not gains.difference
    )
    assert gains.as_recorded(gains.undone_offset(0.004, pressure), pressure) == pytest.approx(0.004)


def test_what_is_unknown_of_flows_grows_with_it() -> None:
    assert after(0.0, 0.0).flow_share == 0.0
    assert after(0.0, 0.01).flow_share == pytest.approx(0.004)
    assert not after(0.0, 0.014).is_too_large
    assert after(0.0, -0.016).is_too_large


def wear_sigma(gains: PressureGains) -> NDArray[np.float64]:
    return np.sqrt(gains.wear_variance(WIDTH))[[Parameter.NOZZLE_BIAS, Parameter.SEAT_BIAS]]


def test_wear_is_unsure_by_an_offset_that_may_be_a_gain() -> None:
    assert wear_sigma(after(0.0, 0.0)) == pytest.approx([0.0, 0.0])
    told, untold = PressureGains().after(0.01, 1.0), after(0.0, 0.01)
    assert wear_sigma(told) == pytest.approx([0.006, 0.012])
    assert wear_sigma(untold) == pytest.approx([0.004, 0.008])


def test_what_was_learned_is_unsure_while_the_gain_becomes_known() -> None:
    """v_H of flows that were seen too large."""
    gains, belief = after(0.0, 0.01, events=4), prior_belief(np.full(WIDTH, 0.2), 1e-8 * np.eye(WIDTH))
    assert gains.rescaled(belief) is belief
    gains = gains.after(0.01 * 1.2, 1.2)
    rescaled = gains.rescaled(belief)
    assert 1.0 + rescaled.mean[Parameter.NOZZLE_BIAS] == pytest.approx(1.2 * (1.0 - 0.005))
    assert rescaled.sigma[Parameter.NOZZLE_BIAS] == pytest.approx(0.005, rel=0.01)
    gains = gains.after(0.01 * 0.6, 0.6)
    assert gains.rescaled(belief).mean == pytest.approx(belief.mean, abs=1e-9)
