"""A model followed open loop along samples."""

import numpy as np

from observer_rt.config.bench import load_bench
from observer_rt.core.model.model import rest_state
from observer_rt.engine.service.constants import bench_constants
from observer_rt.engine.stream.follower import Follower
from observer_rt.model.network import constant_network
from tests.engine.estimation.conftest import event_inputs

CONSTANTS = bench_constants(load_bench().injector)


def follower(nozzle_wear: float = 0.0) -> Follower:
    """At rest at the rail pressure with which the inputs begin."""
    result, state = Follower(CONSTANTS, constant_network(nozzle_wear, 0.0)), np.zeros(3)
    rest_state(state, event_inputs()[0, 0], CONSTANTS.coefficients)
    result.begin(state)
    return result


def test_blocks_are_followed_as_the_whole_is() -> None:
    inputs, resting = event_inputs(), np.zeros(len(event_inputs()), np.bool_)
    complete = follower().run(inputs, resting)
    assert complete.max() > 40e-6  # m3/s
    blocks = follower()
    for first, end in ((0, 130), (130, 131), (131, len(inputs))):
        from_row = max(first - 1, 0)  # the sample that the state belongs to
        rate = blocks.run(inputs[from_row:end], resting[from_row:end])
        np.testing.assert_array_equal(rate[first - from_row :], complete[first:end])


def test_a_worn_model_says_how_it_differs() -> None:
    inputs, resting = event_inputs(), np.zeros(len(event_inputs()), np.bool_)
    phi, nothing = np.empty((3, len(inputs))), np.empty((3, len(inputs)))
    worn, healthy = follower(0.2).run(inputs, resting, phi=phi), follower().run(inputs, resting, phi=nothing)
    assert worn.max() > 1.1 * healthy.max()
    assert phi[0].min() < 0.0
    assert not nothing.any()


def test_before_a_state_is_given_there_is_no_rate() -> None:
    inputs = event_inputs()
    assert np.isnan(Follower(CONSTANTS).run(inputs, np.zeros(len(inputs), np.bool_))[1:]).all()
