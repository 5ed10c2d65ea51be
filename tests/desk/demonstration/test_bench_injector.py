"""The injector that is demonstrated on: right by its equations solved by hand, and every departure is felt."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from observer_rt.desk.demonstration import bench_injector

RATE = 100e3  # Hz
LONG = 30e-3  # s of energizing, until the line no longer rings
PRESSURE = 140e6  # Pa


def recorded(departure: bench_injector.Departure, energizing: float = 1.5e-3) -> bench_injector.BenchRecording:
    return bench_injector.record(
        bench_injector.BenchOperation([PRESSURE], [energizing], 1, 2.0 * LONG), departure, RATE, seed=0
    )


def test_a_long_injection_ends_at_the_flow_at_which_all_pressure_is_used_up() -> None:
    long = recorded(bench_injector.Departure(), LONG)
    last = round((bench_injector.FIRST_EVENT + LONG) * RATE)
    seat = math.pi * bench_injector.HIGHEST_LIFT * math.sin(bench_injector.HALF_CONE)
    seat *= bench_injector.SEAT_FLOW * (
        bench_injector.SEAT_DIAMETER - 0.5 * bench_injector.HIGHEST_LIFT * math.sin(2.0 * bench_injector.HALF_CONE)
    )
    rail = float(np.mean(long.recording.rail_pressure[last - 50 : last]))

    def left(flow: float) -> float:
        line = bench_injector.LOSS_FACTOR * bench_injector.DENSITY / (2.0 * bench_injector.LINE_AREA**2) * flow**2
        orifices = bench_injector.DENSITY / 2.0 * flow**2 * (seat**-2 + bench_injector.NOZZLE_AREA**-2)
        return rail - bench_injector.CHAMBER_PRESSURE - line - orifices

    steady = brentq(left, 0.0, 1e-3)
    assert np.mean(long.injection_rate[last - 50 : last]) == pytest.approx(steady, rel=5e-3)


def test_sensors_show_what_their_departures_say() -> None:
    departures = bench_injector.Departure(), bench_injector.Departure(rail_gain=0.02, hidden_lift=10e-6)
    healthy, shown = map(recorded, departures)
    assert np.mean(shown.recording.rail_pressure / healthy.recording.rail_pressure) == pytest.approx(1.02, rel=1e-3)
    open_ = healthy.recording.needle_lift > 0.1e-3
    hidden = healthy.recording.needle_lift[open_] - shown.recording.needle_lift[open_]
    assert np.mean(hidden) == pytest.approx(10e-6, rel=0.01)
    np.testing.assert_array_equal(shown.injection_rate, healthy.injection_rate)
