"""Noise of a restored lift in the innovations: found by what it does, and no error of a model."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.desk.simulation.simulate import SimulatedNoise
from observer_rt.engine.estimation.phases import Phase
from observer_rt.identification.likelihood.lift_noise import GRID, LiftNoise
from observer_rt.identification.likelihood.likelihood import joint_likelihood
from observer_rt.identification.likelihood.measurement import Measurement, measurements
from observer_rt.model.effects import effective_model, sized
from tests.identification.discovery.hidden import NOMINAL, recordings

MODEL = effective_model(NOMINAL)
LOUD = SimulatedNoise(line_pressure=2e4, needle_lift=1.5e-6)


def test_what_is_found_is_the_variance_beyond_that_without_a_lag() -> None:
    (measurement,) = measurements(recordings(points=((100e6, 1e-3),)))
    noise = measurement.noise.needle_lift

    def innovations(measurement: Measurement, lag: float) -> NDArray[np.float64]:
        return (1.0 + lag / GRID) * measurement.recording.needle_lift / noise

    result = LiftNoise(measurement, innovations)
    assert np.mean(result.variance(2 * GRID)) == pytest.approx(9.0 - 1.0, rel=0.05)
    assert np.mean(result.variance(2.5 * GRID)) == pytest.approx(0.5 * (9.0 + 16.0) - 1.0, rel=0.05)
    assert not result.variance(0.0).any()


def test_the_noise_of_a_restored_lift_speaks_less_against_the_model() -> None:
    lag = sized("needle_lift_sensor_lag", tau=40e-6)
    likelihood = joint_likelihood(measurements(recordings((lag,), True, noise=LOUD)), MODEL)
    judged = likelihood.judge(lag.effect.apply(MODEL, lag.values))
    assert judged is not None
    for recorded, judged_model in zip(likelihood.recordings, judged, strict=True):
        moving = (recorded.phases == Phase.OPENING) | (recorded.phases == Phase.CLOSING)
        assert (
            np.mean(judged_model.z[moving] ** 2) < 2.0
        )  # 3.0 were the lift taken to be as quiet as it was recorded
        assert np.mean(judged_model.rate_z**2) < 0.95  # 1.0 and 1.1, likewise
