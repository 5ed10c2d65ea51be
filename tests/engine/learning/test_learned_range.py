"""What was learned at some operating points holds less at others."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.core.stream.stream import RAIL_BIN, RAIL_BINS
from observer_rt.engine.estimation.parameters import PARAMETERS, Parameter
from observer_rt.engine.estimation.predictor import InputVariance, OpenLoop
from observer_rt.engine.learning import mass
from observer_rt.engine.learning.mass import REACH, EventPoint, KnownFlow, Resimulation, Transfer, extrapolation_sigma

points = st.builds(EventPoint, st.floats(0.1, 2.0), st.floats(-9.0, -5.0), st.floats(0.0, 1.0))


@given(points, st.lists(points, max_size=16), points)
def test_more_events_make_none_stranger(point: EventPoint, learned_at: list[EventPoint], more: EventPoint) -> None:
    before, after = extrapolation_sigma(point, learned_at), extrapolation_sigma(point, [*learned_at, more])
    assert 0.0 <= after <= before + 1e-9 <= 1.0 + 1e-9


def test_it_grows_with_the_distance_to_full() -> None:
    origin = EventPoint(1.0, -7.0, 0.8)
    assert extrapolation_sigma(origin, ()) == 1.0
    away = np.array([extrapolation_sigma(EventPoint(1.0 + d * REACH[0], -7.0, 0.8), [origin]) for d in range(5)])
    assert np.all(np.diff(away) > 0.0)
    assert away[-1] == pytest.approx(1.0, abs=1e-3)


def test_old_points_are_forgotten_and_repeated_ones_leave_little_open() -> None:
    far, near = EventPoint(0.4, -8.0, 0.2), EventPoint(1.6, -6.0, 1.0)
    learned_at: tuple[EventPoint, ...] = (far,)
    for _ in range(mass.MOST_POINTS):
        learned_at = mass.with_point(learned_at, near)
    assert extrapolation_sigma(far, learned_at) > 0.99
    assert extrapolation_sigma(near, learned_at) < 0.2


POINT = EventPoint(1.0, -7.0, 0.5)
UNTRIED, TRIED, SHOWN = Transfer(), Transfer(held=10.0), Transfer(shown=(POINT,))


def flow_known_by(sigmas: dict[int, float], rate: float = 50e-6, transfer: Transfer = SHOWN) -> KnownFlow:
    """After an event of a constant rate [m3/s], with independent errors of theta."""
    filled = 0.9  # p_S / p_L
    slopes = np.zeros((100, PARAMETERS))
    slopes[:, Parameter.NOZZLE_BIAS] = filled * rate
    slopes[:, Parameter.SEAT_BIAS] = (1.0 - filled) * rate
    nothing = np.zeros(100)
    run = OpenLoop(np.full(100, rate), slopes, np.zeros((100, 4)), np.zeros((100, 3, 3)), nothing, nothing, nothing)
    covariance = np.zeros((PARAMETERS, PARAMETERS))
    for column, sigma in sigmas.items():
        covariance[column, column] = sigma**2
    event = Resimulation(run, InputVariance(nothing, nothing), covariance, 1e-5)
    return mass.known_flow(event, np.zeros(PARAMETERS), covariance, POINT, transfer)


WEIGHTS = range(Parameter.NOZZLE_WEIGHT, Parameter.BACK_PRESSURE)


WELL: dict[int, float] = {Parameter.NOZZLE_BIAS: 0.005, Parameter.SEAT_BIAS: 0.005}


def test_a_flow_known_well_is_known_for_as_long_as_openings_since_it_was_other_have_shown() -> None:
    low, pilot, main = (EventPoint(p, math.log(t), 0.5) for p, t in ((0.55, 1.9e-3), (1.0, 0.3e-3), (1.0, 1.2e-3)))
    tried = UNTRIED.after(True, (POINT._replace(rail_pressure=1.6),), ()).after(False, (low,), ())
    result = flow_known_by(WELL, transfer=tried.after(True, (pilot, main), ()))
    middles, since, until = RAIL_BIN * (np.arange(RAIL_BINS) + 0.5), np.array(result.since), np.array(result.until)
    for rail, first, last in ((0.55, 1.9e-3, 1.9e-3), (1.0, 0.3e-3, 1.2e-3)):
        is_near = np.abs(middles - rail) <= mass.NEAR
        assert since[is_near] == pytest.approx(first - mass.LONGER - 2e-5)
        assert until[is_near] == pytest.approx(last + mass.LONGER)
        until[is_near] = 0.0
    assert not until.any()


def test_where_what_was_learned_has_held_at_new_points_it_is_known_at_others() -> None:
    assert flow_known_by(WELL).rail_to < math.inf
    assert set(flow_known_by(WELL, transfer=TRIED).until) == {math.inf}
    assert set(flow_known_by(WELL, transfer=TRIED).since) == {0.0}
    of_pressure = flow_known_by(WELL | dict.fromkeys(WEIGHTS, 0.3), transfer=TRIED)
    assert of_pressure.rail_to < math.inf


def test_a_new_point_at_which_it_failed_is_remembered_for_longer_than_one_at_which_it_held() -> None:
    tried = Transfer()
    trusted = []
    for holds in (*(True,) * 5, False, *(True,) * 60):
        tried = tried.after(holds, (POINT,), (EventPoint(0.5, -7.0, 0.5),))
        trusted.append(tried.is_trusted)
    assert not any(trusted[:3])
    assert trusted[4]
    assert not any(trusted[5:20])
    assert trusted[-1]


def test_flows_that_are_others_again_and_again_spread_and_one_is_forgotten() -> None:
    again, once = Transfer(), Transfer().with_flow(0.5)
    assert once.spread > 0.01
    for _ in range(20):
        again, once = again.with_flow(0.01), once.with_flow(0.005)
    assert once.spread < 2e-3 < 0.006 < again.spread < 0.01


@given(points, st.lists(points, max_size=16))
def test_a_point_is_new_where_no_event_near_it_was_as_long(point: EventPoint, learned_at: list[EventPoint]) -> None:
    longer = [each for each in learned_at if each.log_open_time >= point.log_open_time]
    is_shown = any(abs(each.rail_pressure - point.rail_pressure) <= mass.NEAR for each in longer)
    assert not (is_shown and mass.is_new(point, learned_at))
    assert not mass.is_new(point, [*learned_at, point])
    assert mass.is_new(point, [])


@given(st.floats(1e-4, 0.3), st.floats(1.0, 3.0))
def test_the_less_is_known_of_the_pressure_dependence_the_nearer_it_ends(sigma: float, factor: float) -> None:
    less = flow_known_by(dict.fromkeys(WEIGHTS, factor * sigma))
    more = flow_known_by(dict.fromkeys(WEIGHTS, sigma))
    if less != mass.NOWHERE:
        assert more.rail_from <= less.rail_from <= 1.0 <= less.rail_to <= more.rail_to


@pytest.mark.parametrize(("sigma", "rate"), [(0.1, 50e-6), (0.0, 0.0)])
def test_what_not_even_the_event_showed_is_known_nowhere(sigma: float, rate: float) -> None:
    assert flow_known_by({Parameter.NOZZLE_BIAS: sigma}, rate) == mass.NOWHERE
