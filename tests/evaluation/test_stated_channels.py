"""Recordings and logs of late and slow channels, by a bench file that says so."""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.config.bench import Bench, load_bench, load_injector
from observer_rt.evaluation.evaluate import evaluate
from observer_rt.model.effects import sized
from observer_rt.recording.signals.recording import Recording
from observer_rt.simulation.schedule import make_schedule
from observer_rt.simulation.simulate import Simulation, simulate
from tests.benches import bench_with

RATE, FINE = 100e3, 1e6
LATE = {"rail_pressure": 31e-6, "needle_lift": 23e-6, "line_pressure": 44e-6}  # s


@cache
def made() -> Simulation:
    """Without noise; slow sensors, nothing late."""
    effects = (sized("needle_lift_sensor_lag", tau=16e-6), sized("line_pressure_sensor_lag", tau=9e-6))
    schedule = make_schedule([100e6], 5, 0.03, [1.1e-3])
    return simulate(load_injector(), schedule, FINE, effects, None)


def recorded(late: dict[str, float]) -> Recording:
    """At RATE, each channel late by so much [s]."""
    fine = made().recording
    time = fine.time[:: round(FINE / RATE)]

    def shown(role: str) -> NDArray[np.float64]:
        return np.asarray(np.interp(time - late[role], fine.time, getattr(fine, role)))

    return Recording(time, shown("rail_pressure"), shown("needle_lift"), shown("line_pressure"))


def rmse(bench: Bench, recording: Recording) -> float:
    """Of the rate [mm3/ms] over the injections."""
    trace = evaluate(bench, [recording], learning=False).evaluations[0].trace
    true = made().truth.injection_rate[:: round(FINE / RATE)]
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
    assert rmse(load_bench(), recorded(LATE)) > 8.0 * quick


@pytest.mark.parametrize("role", LATE)
def test_each_delay_by_itself(role: str) -> None:
    alone = dict.fromkeys(LATE, 0.0) | {role: LATE[role]}
    on_time = dict.fromkeys(LATE, 0.0)
    right, wrong = (rmse(bench_with(**keys(stated)), recorded(alone)) for stated in (alone, on_time))
    assert right < 1.5 * rmse(bench_with(**keys(on_time)), recorded(on_time))
    if role != "rail_pressure":  # at rest it has no time
        assert wrong > 2.0 * right
