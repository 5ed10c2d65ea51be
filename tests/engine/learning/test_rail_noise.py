"""Noise of the rail pressure, which runs along a line with waves, moves no mass: it passes for no late sensor."""

from dataclasses import replace

import numpy as np
import pytest

from tests.engine.learning.learner_adapter import GOLDEN
from tests.observed_plants import bench_at, observed
from tests.plants.arrays import Array
from tests.plants.histories import POINTS, WEAR, Kind, bench_of
from tests.plants.plant import RAIL, seen_as
from tools.benchmarks.discovery.discrepancies import Discrepancy
from tools.benchmarks.worn_lines import on_line

LINE, SEED = Discrepancy.PLAIN, 1


@pytest.mark.parametrize(("noise", "hum"), [(0.6e6, 0.0), (0.0, 1e6)])  # six times the usual one; Pa
def test_noise_of_the_rail_moves_no_mass_on_a_line_with_waves(noise: float, hum: float) -> None:
    def supply(time: Array) -> Array:
        return hum * np.sin(2.0 * np.pi * 620.0 * time)  # the pipe hears it, the sensor does not

    def measured(time: Array, values: Array) -> Array:
        return values - supply(time) + np.random.default_rng(5).normal(0.0, noise, time.size)

    bench = on_line(bench_of(Kind(WEAR[0]), POINTS[::2] * 3, SEED, "rail noise"), LINE, SEED)
    steps, supplies = (*bench.around.before_noise, seen_as(RAIL, measured)), (*bench.around.supply, supply)
    bench = replace(bench, around=replace(bench.around, before_noise=steps, supply=supplies))
    run = observed(bench, bench_at(bench.sample_rate, GOLDEN / f"{LINE}.toml"))[3:]
    assert all(run.valid)
    assert np.abs(run.errors).max() < 0.012
    assert sum(run.inside) >= len(run.reports) - 1
