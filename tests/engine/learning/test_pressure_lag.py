"""A lag of the line-pressure sensor and a channel recorded late are distinguished."""

from functools import cache

from observer_rt.config.bench import load_bench
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.engine.stream.state import Reason
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import sized
from tests.engine.sample_stream import NOMINAL

LAGGING = sized("line_pressure_sensor_lag", tau=40e-6)
LATE = sized("channel_skew", d=30e-6)
SHORT = sized("channel_skew", d=12e-6)
NOISE = SimulatedNoise()
QUIET = SimulatedNoise(rail_pressure=0.05e6, line_pressure=0.03e6)
EVENTS = 12


@cache
def reasons(*effects: SizedEffect, noise: SimulatedNoise = NOISE) -> tuple[Reason, ...]:
    """Why each of twelve injections at three pressures and two durations is not valid."""
    schedule = make_schedule([60e6, 100e6, 140e6], EVENTS, 0.05, [0.8e-3, 1.9e-3])
    recording = simulate(NOMINAL, schedule, 100e3, effects, noise, seed=5).recording
    reports = evaluate(load_bench().exact, [recording]).evaluations[0].reports
    return tuple(report.reason for report in reports)


def test_a_lag_is_believed() -> None:
    assert reasons(LAGGING)[1:] == (Reason.NONE,) * (EVENTS - 1)


def test_a_channel_recorded_late_is_not_taken_for_a_lag() -> None:
    assert {*reasons(LATE), *reasons(LATE, noise=QUIET)} == {Reason.TIME_BASE}


def test_an_unstated_filter_of_the_line_is_no_reason_to_refuse() -> None:
    """12 us late, which quiet sensors tell from a lag, move the live rate by a third of a percent of its peak."""
    assert reasons(SHORT, noise=QUIET) == (Reason.NONE,) * EVENTS
