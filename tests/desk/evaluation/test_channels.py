"""Recordings through benches whose messages carry no index, or whose channels are late or slow: as on the bus."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.config.bench import Bench, load_bench, load_injector
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, Simulation, simulate
from observer_rt.files.signals.recording import Recording
from observer_rt.model.effects import sized
from tests.benches import bench_with
from tests.daemon.time_frames import write_time_bench
from tests.daemon.time_scenarios import NIBBLE, SLOW, STAMPS, slow

RATE = 20e3
LOCKED = round(1.05 * RATE)  # samples until clocks are known


@pytest.fixture(scope="module")
def made() -> Simulation:
    schedule = make_schedule([100e6], 24, 0.05, [1.1e-3])
    return simulate(load_injector(), schedule, RATE, (), SimulatedNoise(), seed=4)


@pytest.mark.parametrize("signals", [STAMPS, NIBBLE, slow(SLOW)], ids=["stamps", "counter", "slow rail"])
def test_second_recording_of_a_history_is_found(tmp_path: Path, made: Simulation, signals: dict[str, str]) -> None:
    """Over the pause the count goes on by stamps; the second recording's samples are where they belong."""
    bench = load_bench(write_time_bench(tmp_path, RATE, signals))
    first, second = evaluate(bench, [made.recording] * 2, learning=False).evaluations
    late = slice(LOCKED, made.recording.samples - 200)
    assert np.mean(second.trace.valid[late]) > 0.999
    assert first.counters.lost_samples == 0
    error = second.trace.injection_rate[late] - made.truth.injection_rate[late]
    assert np.quantile(np.abs(error), 0.999) < 3e-6


FAST, FINE = 100e3, 1e6
LATE = {"rail_pressure": 31e-6, "needle_lift": 23e-6, "line_pressure": 44e-6}  # s


@cache
def slow_sensors() -> Simulation:
    effects = (sized("needle_lift_sensor_lag", tau=16e-6), sized("line_pressure_sensor_lag", tau=9e-6))
    schedule = make_schedule([100e6], 5, 0.03, [1.1e-3])
    return simulate(load_injector(), schedule, FINE, effects, None)


def recorded(late: dict[str, float]) -> Recording:
    fine = slow_sensors().recording
    time = fine.time[:: round(FINE / FAST)]

    def shown(role: str) -> NDArray[np.float64]:
        return np.asarray(np.interp(time - late[role], fine.time, getattr(fine, role)))

    return Recording(time, shown("rail_pressure"), shown("needle_lift"), shown("line_pressure"))


def rmse(bench: Bench, recording: Recording) -> float:
    trace = evaluate(bench, [recording], learning=False).evaluations[0].trace
    true = slow_sensors().truth.injection_rate[:: round(FINE / FAST)]
    is_open = np.convolve(true > 0.0, np.ones(20), "same") > 0.0
    error = (trace.injection_rate - true)[is_open]
    assert np.isfinite(error).mean() > 0.99
    return 1e6 * float(np.sqrt(np.nanmean(error**2)))


def keys(late: dict[str, float]) -> dict[str, dict[str, float]]:
    lags = {"rail_pressure": {}, "needle_lift": {"lag_us": 16.0}, "line_pressure": {"lag_us": 9.0}}
    return {role: {"filter_delay_us": 1e6 * delay, **lags[role]} for role, delay in late.items()}


def test_rates_are_those_of_quick_channels_at_their_times() -> None:
    on_time = dict.fromkeys(LATE, 0.0)
    quick = rmse(bench_with(**keys(on_time)), recorded(on_time))
    assert rmse(bench_with(**keys(LATE)), recorded(LATE)) < 1.5 * quick
    assert rmse(load_bench().exact, recorded(LATE)) > 8.0 * quick
