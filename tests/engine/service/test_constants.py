"""What a bench file says of time reaches the observer in samples; a model followed along these."""

import numpy as np
import pytest

from observer_rt.config.bench import load_bench
from observer_rt.config.injector_sections import SamplingConfig
from observer_rt.core.stream.stream import SAMPLE
from observer_rt.engine.service.injector import bench_constants
from observer_rt.engine.service.nominal import Follower


@pytest.mark.parametrize(("rate", "bridge", "samples"), [(100e3, 0.5, 50), (100e3, 0.0, 0), (20e3, 2.0, 40)])
def test_how_long_an_input_is_bridged(rate: float, bridge: float, samples: int) -> None:
    bench = load_bench().with_sections(sampling=SamplingConfig(rate_hz=rate, bridge_ms=bridge))
    assert bench_constants(bench.injector).timing.bridge == samples


def test_before_a_state_is_given_there_is_no_rate() -> None:
    rows = np.zeros(20, SAMPLE)
    rows["rail_pressure"], rows["seat_area"] = 0.95, 0.9
    assert np.isnan(Follower(bench_constants(load_bench().injector)).along(rows)[1:]).all()
