"""A needle lift recorded late is named as that, another wrong model is not."""

from functools import cache
from itertools import count

import numpy as np
import pytest

from observer_rt.config.bench import load_bench
from observer_rt.estimation.prediction_error import EventCost
from observer_rt.estimation.predictor import Window
from observer_rt.estimation.scalars import SCALARS
from observer_rt.evaluation.evaluate import evaluate
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import sized
from observer_rt.observer.learning.lateness import LiftLag, LiftLagSearch, lift_lag_of
from observer_rt.observer.stream.state import Reason
from observer_rt.simulation.schedule import make_schedule
from observer_rt.simulation.simulate import SimulatedNoise, simulate
from tests.estimation.conftest import event_inputs, make_case, simulated_event, worn_theta
from tests.observer.sample_stream import NOMINAL

EVENTS = 12
EXPLAINED = LiftLag(16e-6, without=300.0, left=10.0, samples=1200)
OF_ANOTHER_CAUSE = LiftLag(16e-6, without=300.0, left=200.0, samples=1200)
SMALL = LiftLag(16e-6, without=12.0, left=0.0, samples=1200)
STILL_WRONG = LiftLag(60e-6, without=9000.0, left=2000.0, samples=1200)


@cache
def reasons(*effects: SizedEffect) -> tuple[Reason, ...]:
    """Why each of twelve injections at three pressures and two durations is not valid."""
    schedule = make_schedule([60e6, 100e6, 140e6], EVENTS, 0.05, [0.8e-3, 1.9e-3])
    recording = simulate(NOMINAL, schedule, 100e3, effects, SimulatedNoise(), seed=5).recording
    reports = evaluate(load_bench(), [recording]).evaluations[0].reports
    return tuple(report.reason for report in reports)


@pytest.mark.parametrize("wear", [0.0, 0.25])
@pytest.mark.parametrize("lag", [15e-6, 40e-6])
def test_a_slow_lift_sensor_is_named(lag: float, wear: float) -> None:
    found = reasons(sized("needle_lift_sensor_lag", tau=lag), sized("orifice_area", v_H=wear))
    assert found[4:] == (Reason.LIFT_SENSOR_LAG,) * (EVENTS - 4)


def test_a_line_pressure_that_is_late_is_none() -> None:
    found = reasons(sized("channel_skew", d=50e-6))
    assert Reason.NONE not in found[4:]
    assert Reason.LIFT_SENSOR_LAG not in found


def test_another_seat_is_none() -> None:
    found = reasons(sized("seat_outflow"))
    assert Reason.NONE not in found[4:]
    assert Reason.LIFT_SENSOR_LAG not in found


@pytest.mark.parametrize("late", [0.0, 16e-6, 30e-6])
def test_the_lag_is_found_although_the_nozzle_is_worn(late: float) -> None:
    case = make_case(NOMINAL)
    window = simulated_event(case, worn_theta(), event_inputs(), seed=3)
    samples = np.arange(len(window.output))
    area = np.interp(samples - late / case.setting.interval, samples, window.inputs[:, 1])
    recorded = window._replace(inputs=np.column_stack([window.inputs[:, 0], area]))

    def cost_of(moved: Window) -> EventCost:
        return EventCost(moved, case.setting, case.schedule.innovation_sigma, burn_in=50)

    found = lift_lag_of(recorded, case.setting, cost_of, SCALARS)
    assert found.lag == pytest.approx(late, abs=4e-6)
    assert found.left <= found.without


def test_what_explains_recent_events_is_told() -> None:
    search = LiftLagSearch()
    assert [search.found_after(lambda _: EXPLAINED) for _ in range(3)] == pytest.approx([16e-6] * 3)


@pytest.mark.parametrize("event", [OF_ANOTHER_CAUSE, SMALL, STILL_WRONG])
def test_what_does_not_is_not(event: LiftLag) -> None:
    search = LiftLagSearch()
    assert [search.found_after(lambda _: event) for _ in range(10)] == [None] * 10


def test_where_events_are_refused_for_long_few_are_asked() -> None:
    """Asking takes long, and the answer does not change."""
    search, asked = LiftLagSearch(), count()

    def ask(_: float) -> LiftLag:
        next(asked)
        return EXPLAINED

    assert all(search.found_after(ask) for _ in range(64))
    assert next(asked) == 6 + 64 // 8
    search.told((), ask)
    search.found_after(ask)
    assert next(asked) == 6 + 64 // 8 + 2
