"""The benchmark's peer: a joint filter equal to filterpy's."""

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from numpy.typing import NDArray

from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Outcome, Shot, record
from tools.benchmarks.joint_ukf import (
    UNSCENTED_SHAPE,
    Stream,
    advance,
    lump_model,
    set_at_rest,
    start_of,
    stream_of,
    unscented,
)


def recorded(faults: Faults, events: int) -> Outcome:
    rails = (60e6, 130e6, 90e6)
    planned = tuple(Event(rails[i % 3], (Shot(0.0, 1.5e-3),), faults) for i in range(events))
    return record(Bench(Injector(), Needle(), planned, seed=3))


def test_joint_ukf_is_filterpys() -> None:
    """From shortly before an injection to shortly after the sac is at rest again."""
    cut, model = slice(14_900, 15_700), lump_model(Injector())
    inputs, output, resting, interval, substeps = stream_of(
        recorded(Faults(orifice_area=0.3), 1).measured, Injector()
    )
    stream = Stream(inputs[cut], output[cut], resting[cut], interval, substeps)
    assert stream.resting[-1]
    assert not stream.resting.all()
    sample = 0

    def transition(x: NDArray[np.float64], _: float) -> NDArray[np.float64]:
        return np.array([*advance(x[0], x[1], x[2], sample, stream, x[3], model), x[3]])

    points = MerweScaledSigmaPoints(4, *UNSCENTED_SHAPE)
    ukf = UnscentedKalmanFilter(4, 1, stream.interval, lambda x: x[:1], transition, points)
    start = start_of(stream, model)
    ukf.x, ukf.P, ukf.Q, measurement = (np.array(each) for each in start)
    ukf.R = np.eye(1) * measurement
    expected = [ukf.x.copy()]
    for sample in range(stream.output.size - 1):
        ukf.predict()
        ukf.update(stream.output[sample + 1 : sample + 2])
        if stream.resting[sample + 1]:
            set_at_rest(ukf.x, ukf.P)
        expected.append(ukf.x.copy())
    states = np.full((stream.output.size, 4), np.nan)
    assert unscented(stream, model, start, UNSCENTED_SHAPE, states)
    assert np.ptp(states[:, 3]) > 0.1
    np.testing.assert_allclose(states, np.array(expected), rtol=0.0, atol=1e-9)
