"""What a bench file says of time reaches the observer in samples; a model followed open loop along these."""

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.config.bench import load_bench
from observer_rt.config.injector_sections import SamplingConfig
from observer_rt.core.model.model import rest_state
from observer_rt.core.stream.stream import SAMPLE
from observer_rt.engine.service.injector import bench_constants
from observer_rt.engine.service.nominal import Follower
from tests.engine.estimation.conftest import event_inputs

CONSTANTS = bench_constants(load_bench().injector)


@pytest.mark.parametrize(("rate", "bridge", "samples"), [(100e3, 0.5, 50), (100e3, 0.0, 0), (20e3, 2.0, 40)])
def test_how_long_an_input_is_bridged(rate: float, bridge: float, samples: int) -> None:
    bench = load_bench().with_sections(sampling=SamplingConfig(rate_hz=rate, bridge_ms=bridge))
    assert bench_constants(bench.injector).timing.bridge == samples


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
