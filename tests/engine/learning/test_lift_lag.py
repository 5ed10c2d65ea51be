"""A needle lift recorded late is named as that, another wrong model is not."""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from itertools import count

import numpy as np
import pytest

from observer_rt.engine.estimation.phases import Phase
from observer_rt.engine.estimation.prediction_error import EventCost
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.adequacy import Objection
from observer_rt.engine.learning.lift_lag import LiftLag, LiftLagSearch, lift_lag_of
from observer_rt.engine.stream.state import Reason
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effects import sized
from tests.engine.estimation.conftest import event_inputs, make_case, simulated_event, worn_theta
from tests.engine.learning.test_pressure_lag import EVENTS, reasons
from tests.engine.sample_stream import NOMINAL
from tests.observed_plants import observed
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Shot

REFUSED = (Objection(Reason.MODEL_INADEQUATE, Phase.OPENING),)
EXPLAINED = LiftLag(16e-6, without=300.0, left=10.0, samples=1200)
OF_ANOTHER_CAUSE = LiftLag(16e-6, without=300.0, left=200.0, samples=1200)
OF_THE_CHAMBER = replace(EXPLAINED, by_chamber=8.0)
SMALL = LiftLag(16e-6, without=12.0, left=0.0, samples=1200)
STILL_WRONG = LiftLag(60e-6, without=9000.0, left=2000.0, samples=1200)
NEARLY_ALL = LiftLag(28e-6, without=2000.0, left=180.0, samples=240)
NO_MORE_THAN_NOISE = LiftLag(16e-6, without=-490.0, left=-640.0, samples=1200)


@pytest.mark.parametrize(("lag", "wear"), [(15e-6, 0.25), (40e-6, 0.0)])
def test_a_slow_lift_sensor_is_named(lag: float, wear: float) -> None:
    result = reasons(sized("needle_lift_sensor_lag", tau=lag), sized("orifice_area", v_H=wear))
    assert result[4:].count(Reason.LIFT_SENSOR_LAG) >= EVENTS - 5  # one may be a law of the seat, not yet known
    assert set(result[4:]) <= {Reason.LIFT_SENSOR_LAG, Reason.OUTSIDE_LEARNED_RANGE}


@pytest.mark.parametrize("lag", [20e-6, 32e-6])
@pytest.mark.parametrize("durations", [(1.4e-3,), (1.4e-3, 0.9e-3)])
def test_laws_learned_do_not_stand_for_a_late_lift(lag: float, durations: tuple[float, ...]) -> None:
    """At one rail pressure laws of nozzle and seat explain every event, with masses that are wrong."""
    shots = [Shot(7e-6 * k, durations[k % len(durations)]) for k in range(16)]
    worn_and_late = Faults(orifice_area=-0.3, lift_sensor_lag=lag)
    events = tuple(Event(100e6, (shot,), worn_and_late) for shot in shots)
    run = observed(Bench(Injector(), Needle(), events, seed=11))
    assert not any(run.valid)
    assert {report.reason for report in run.reports[2:]} == {Reason.LIFT_SENSOR_LAG}


@pytest.mark.parametrize(("left_by_laws", "is_late"), [(0.0, True), (-20.0, False), (None, False)])
def test_an_explained_event_is_late_where_a_lag_explains_it_as_well_as_laws(
    left_by_laws: float | None, is_late: bool
) -> None:
    _, objections = LiftLagSearch().after((), left_by_laws, lambda _: EXPLAINED)
    assert [each.reason for each in objections] == [Reason.LIFT_SENSOR_LAG] * is_late


@pytest.mark.parametrize("other", [sized("channel_skew", d=50e-6), sized("seat_outflow")])
def test_a_late_line_pressure_or_another_seat_is_none(other: SizedEffect) -> None:
    result = reasons(other)
    assert Reason.NONE not in result[4:]
    assert Reason.LIFT_SENSOR_LAG not in result


@pytest.mark.parametrize("late", [0.0, 16e-6, 30e-6])
def test_the_lag_is_found_although_the_nozzle_is_worn(late: float) -> None:
    case = make_case(NOMINAL)
    window = simulated_event(case, worn_theta(), event_inputs(), seed=3)
    samples = np.arange(len(window.output))
    area = np.interp(samples - late / case.setting.interval, samples, window.inputs[:, 1])
    recorded = window._replace(inputs=np.column_stack([window.inputs[:, 0], area]))

    def cost_of(moved: Window) -> EventCost:
        return EventCost(moved, case.setting, case.schedule.innovation_sigma, burn_in=50)

    result = lift_lag_of(recorded, case.setting, cost_of)
    assert result.lag == pytest.approx(late, abs=4e-6)
    assert result.left <= result.without


def lags_found(events: Iterable[LiftLag]) -> list[float | None]:
    """After each of the refused events."""
    search, lags = LiftLagSearch(), []
    for event in events:
        search, _ = search.after(REFUSED, None, partial(lambda event, _: event, event))
        lags.append(search.accepted_lag)
    return lags


def test_what_explains_recent_events_is_told() -> None:
    assert lags_found([EXPLAINED] * 3) == pytest.approx([16e-6] * 3)


def test_on_a_fitted_line_something_may_be_left() -> None:
    assert lags_found([NEARLY_ALL]) == pytest.approx([28e-6])


def test_a_lag_that_differs_from_event_to_event_is_none() -> None:
    """As a nozzle with other holes gives: the sensor would be as slow at every rail pressure."""
    first, *others = lags_found([replace(EXPLAINED, missed=30.0)] * 4)
    assert first is not None  # nothing was expected yet
    assert others == [None] * 3


@pytest.mark.parametrize(("pressure", "lag"), [(15e6, 0.0), (25e6, 0.0), (5e6, 15e-6)])
def test_a_sac_that_rests_at_another_pressure_is_no_late_lift(pressure: float, lag: float) -> None:
    """The file says 5 MPa; by how little the nozzle's law is another then, the network may learn."""
    events = tuple(
        Event(rail, (Shot(0.0, 1.5e-3),), Faults(lift_sensor_lag=lag)) for rail in (60e6, 100e6, 140e6) * 3
    )
    run = observed(Bench(Injector(chamber_pressure=pressure), Needle(), events, seed=2))
    reports = run.reports[2:]
    errors = np.abs(run.errors[2:])[[report.valid for report in reports]]
    assert errors.max(initial=0.0) < 0.02
    assert any(report.reason is Reason.LIFT_SENSOR_LAG for report in reports) is (lag > 0.0)


@pytest.mark.parametrize("event", [OF_ANOTHER_CAUSE, SMALL, STILL_WRONG, OF_THE_CHAMBER, NO_MORE_THAN_NOISE])
def test_what_does_not_is_not(event: LiftLag) -> None:
    assert lags_found([event] * 10) == [None] * 10


def test_where_events_are_refused_for_long_few_are_asked() -> None:
    """Asking takes long, and the answer does not change."""
    search, asked = LiftLagSearch(), count()

    def ask(_: float) -> LiftLag:
        next(asked)
        return EXPLAINED

    for _ in range(64):
        search, _ = search.after(REFUSED, None, ask)
        assert search.accepted_lag
    assert next(asked) == 6 + 64 // 8
    search, _ = search.after((), None, ask)
    search.after(REFUSED, None, ask)
    assert next(asked) == 6 + 64 // 8 + 2
