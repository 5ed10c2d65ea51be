"""The benchmark's peers: filters equal to filterpy's."""

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter
from numpy.typing import NDArray

from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Outcome, Shot, record
from tools.benchmarks.kalman_peers import UNSCENTED_SHAPE, joint_ekf, joint_ukf, start_of
from tools.benchmarks.peer_equations import PeerInputs, Stream, joint_jacobian, joint_step, peer_inputs, rest
from tools.benchmarks.peers import TUNING


def recorded(faults: Faults, events: int) -> Outcome:
    rails = (60e6, 130e6, 90e6)
    planned = tuple(Event(rails[i % 3], (Shot(0.0, 1.5e-3),), faults) for i in range(events))
    return record(Bench(Injector(), Needle(), planned, seed=3))


@pytest.fixture(scope="module")
def one_injection() -> PeerInputs:
    """From shortly before an injection to shortly after the sac is at rest again."""
    whole = peer_inputs(recorded(Faults(orifice_area=0.3), 1).measured)
    cut = slice(14_900, 15_700)
    inputs, output, resting, interval, substeps = whole.stream
    stream = Stream(inputs[cut], output[cut], resting[cut], interval, substeps)
    assert stream.resting[-1]
    assert not stream.resting.all()
    return PeerInputs(whole.model, stream, whole.events)


def test_joint_ukf_is_filterpys(one_injection: PeerInputs) -> None:
    stream, model = one_injection.stream, one_injection.model
    sample = 0

    def transition(x: NDArray[np.float64], _: float) -> NDArray[np.float64]:
        return np.asarray(joint_step(np.ascontiguousarray(x), sample, stream, model), np.float64)

    points = MerweScaledSigmaPoints(4, *UNSCENTED_SHAPE)
    ukf = UnscentedKalmanFilter(4, 1, stream.interval, lambda x: x[:1], transition, points)
    ukf.x, ukf.P, ukf.Q, measurement = start_of(one_injection, TUNING)
    ukf.R = np.eye(1) * measurement
    expected = [ukf.x.copy()]
    for sample in range(stream.output.size - 1):
        ukf.predict()
        ukf.update(stream.output[sample + 1 : sample + 2])
        if stream.resting[sample + 1]:
            rest(ukf.x, ukf.P)
        expected.append(ukf.x.copy())
    ours = joint_ukf(one_injection, TUNING)
    assert ours.survived
    assert np.ptp(ours.states[:, 3]) > 0.1
    np.testing.assert_allclose(ours.states, np.array(expected), rtol=0.0, atol=1e-9)


def test_joint_ekf_is_filterpys(one_injection: PeerInputs) -> None:
    stream, model = one_injection.stream, one_injection.model

    ekf = ExtendedKalmanFilter(4, 1)
    ekf.predict_x = lambda u: None  # the model is not linear: below
    ekf.x, ekf.P, ekf.Q, measurement = start_of(one_injection, TUNING)
    ekf.R = np.eye(1) * measurement
    expected = [ekf.x.copy()]
    for sample in range(stream.output.size - 1):
        ekf.F = joint_jacobian(ekf.x, sample, stream, model)
        ekf.x = joint_step(ekf.x, sample, stream, model)
        ekf.predict()
        ekf.update(stream.output[sample + 1 : sample + 2], lambda _: np.eye(1, 4), lambda x: x[:1])
        if stream.resting[sample + 1]:
            rest(ekf.x, ekf.P)
        expected.append(ekf.x.copy())
    ours = joint_ekf(one_injection, TUNING)
    assert ours.survived
    np.testing.assert_allclose(ours.states, np.array(expected), rtol=0.0, atol=1e-9)


def test_joint_filters_find_nozzle_wear() -> None:
    inputs = peer_inputs(recorded(Faults(orifice_area=0.3), 4).measured)
    for run in (joint_ukf, joint_ekf):
        assert run(inputs, TUNING).states[-1, 3] == pytest.approx(0.3, abs=0.02)
