"""The benchmark's peer: a filter equal to filterpy's."""

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from numpy.typing import NDArray

from tests.plants.parameters import Faults, Injector
from tests.plants.plant import LINE_NOISE, Bench, Event, Needle, Shot, record
from tools.benchmarks import unscented

INTERVAL = 1e-5


def test_the_unscented_filter_is_filterpys() -> None:
    """From shortly before an injection to shortly after the sac is at rest again."""
    cut, model = slice(14_900, 15_700), unscented.coefficients(Injector())
    worn = Event(60e6, (Shot(0.0, 1.5e-3),), Faults(orifice_area=0.3))
    measured = record(Bench(Injector(), Needle(), (worn,), seed=3)).measured
    stream = inputs, output, resting = tuple(each[cut] for each in unscented.stream_of(measured, Injector()))
    assert resting[-1]
    assert not resting.all()
    sample = 0

    def transition(x: NDArray[np.float64], _: float) -> NDArray[np.float64]:
        after = x.copy()
        unscented.advance(after, inputs[sample], inputs[sample + 1], INTERVAL, model)
        return after

    points = MerweScaledSigmaPoints(unscented.STATES, *unscented.SHAPE)
    ukf = UnscentedKalmanFilter(unscented.STATES, 1, INTERVAL, lambda x: x[:1] + x[6:], transition, points)
    start = np.append(output[0], np.zeros(unscented.STATES - 1))
    ukf.x, ukf.P, ukf.Q = start.copy(), np.diag(unscented.PRIORS**2), unscented.noise_of(model, INTERVAL)
    ukf.R = np.eye(1) * (unscented.MEASURED_NOISE * LINE_NOISE / unscented.PRESSURE_SCALE) ** 2
    expected = [ukf.x.copy()]
    for sample in range(output.size - 1):
        ukf.predict()
        ukf.update(output[sample + 1 : sample + 2])
        if resting[sample + 1]:
            ukf.x[2] = ukf.P[2, :] = ukf.P[:, 2] = 0.0
            ukf.P[2, 2] = unscented.RESTING
        expected.append(ukf.x.copy())
    states = unscented.filtered(
        stream, model, INTERVAL, start, np.diag(unscented.PRIORS**2), unscented.noise_of(model, INTERVAL)
    )
    assert np.ptp(states[:, 3]) > 0.1
    np.testing.assert_allclose(states, np.array(expected), rtol=0.0, atol=1e-8)
