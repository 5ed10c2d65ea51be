"""A model followed open loop along samples."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import load_bench
from observer_rt.core.model.model import rest_state
from observer_rt.core.stream.stream import SAMPLE
from observer_rt.engine.service.injector import Follower, bench_constants
from tests.engine.estimation.conftest import event_inputs

CONSTANTS = bench_constants(load_bench().injector)


def event_rows() -> NDArray[np.void]:
    inputs = event_inputs()
    rows = np.zeros(len(inputs), SAMPLE)
    rows["rail_pressure"], rows["seat_area"] = inputs.T
    return rows


def test_blocks_are_followed_as_the_whole_is() -> None:
    rows, state = event_rows(), np.zeros(3)
    rest_state(state, rows["rail_pressure"][0], CONSTANTS.coefficients)
    followers = Follower(CONSTANTS), Follower(CONSTANTS)
    for follower in followers:
        follower.begin(state)
    complete = followers[0].along(rows)
    assert complete.max() > 40e-6  # m3/s
    for first, end in ((0, 130), (130, 131), (131, len(rows))):
        from_row = max(first - 1, 0)  # the sample that the state belongs to
        rate = followers[1].along(rows[from_row:end])
        np.testing.assert_array_equal(rate[first - from_row :], complete[first:end])


def test_before_a_state_is_given_there_is_no_rate() -> None:
    assert np.isnan(Follower(CONSTANTS).along(event_rows())[1:]).all()
