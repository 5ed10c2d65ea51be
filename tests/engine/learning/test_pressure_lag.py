"""A lag of the line-pressure sensor and a channel recorded late are distinguished."""

from collections.abc import Iterable
from functools import cache

import numpy as np
import pytest

from observer_rt.config.bench import load_bench
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.engine.estimation.gating import prior_belief
from observer_rt.engine.estimation.prediction_error import EventCost
from observer_rt.engine.estimation.scalars import PARAMETERS, SCALARS, Parameter
from observer_rt.engine.learning.fitting import EventFitter, theta_limits
from observer_rt.engine.learning.pressure_lag import RELEVANT_RATE, LagDoubt, Lateness, lag_score, no_doubt
from observer_rt.engine.stream.state import Reason
from observer_rt.model.effect import SizedEffect
from observer_rt.model.effective import LAG_UNIT
from observer_rt.model.effects import sized
from tests.engine.estimation.conftest import event_inputs, make_case, simulated_event, worn_theta
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
    assert set(reasons(LATE)) == {Reason.TIME_BASE}


def test_score_of_a_fit_is_not_changed_by_what_was_tried_after_it_and_needs_a_stable_model() -> None:
    """An event that contradicts may keep its first fit, though another was tried from a wide prior."""
    case = make_case(NOMINAL)
    lagging = np.zeros(PARAMETERS)
    lagging[Parameter.SENSOR_LAG] = 40e-6 / LAG_UNIT
    window = simulated_event(case, lagging, event_inputs(), seed=3)
    cost = EventCost(window, case.setting, case.schedule.innovation_sigma, burn_in=50)
    wide = SCALARS.prior(case.c.pressure_scale)
    fitter = EventFitter(cost, frozenset(), theta_limits(case.c))
    fit = fitter.fit(cost.linearised(lagging), prior_belief(lagging, np.diag(wide**2)), 2)
    before = lag_score(window, case.setting, fit, cost, wide)
    assert before is not None
    elsewhere = cost.linearised(worn_theta())
    fitter.fit(elsewhere, prior_belief(worn_theta(), np.diag((1e-3 * wide) ** 2)), 1)
    after = lag_score(window, case.setting, fit, cost, wide)
    assert after is not None
    assert after.score == before.score
    wild = window._replace(output=np.where(np.arange(window.output.size) > 200, 1e200, window.output))
    assert lag_score(wild, case.setting, fit, cost, wide) is None  # with a delay the model is not stable


def doubts(scores: Iterable[float], rate_share: float = 2.0 * RELEVANT_RATE) -> list[LagDoubt]:
    """After each of the events with these scores."""
    doubt, result = no_doubt(2), []
    for score in scores:
        doubt = doubt.after(Lateness(score, rate_share, 0.004, np.array([0.01, 0.0])))
        result.append(doubt)
    return result


def test_white_scores_hardly_ever_contradict_a_lag() -> None:
    assert not any(doubt.is_relevant for doubt in doubts(np.random.default_rng(6).normal(size=5000)))


@pytest.mark.parametrize("pull", [-3.0, 3.0])
def test_scores_of_one_sign_do(pull: float) -> None:
    assert [doubt.is_relevant for doubt in doubts([pull] * 4)] == [False, False, True, True]


def test_without_a_lag_all_is_forgotten() -> None:
    doubt = doubts([-3.0] * 5)[-1].after(None)
    assert not doubt.is_relevant
    assert doubt.volume_share == 0.0
    assert not doubt.after(Lateness(-3.0, 2.0 * RELEVANT_RATE, 0.004, np.zeros(2))).is_relevant


def test_a_delay_too_short_to_matter_only_widens_the_interval() -> None:
    result = doubts([-3.0] * 8, 0.5 * RELEVANT_RATE)
    assert not any(doubt.is_relevant for doubt in result)
    assert result[-1].volume_share == pytest.approx(0.004)
    assert result[-1].variance == pytest.approx([1e-4, 0.0])


def test_a_lag_widens_nothing() -> None:
    result = doubts((0.5, -1.0, 0.2))
    assert not any(doubt.is_relevant for doubt in result)
    assert result[-1].volume_share == 0.0


def test_an_unstated_filter_of_the_line_is_no_reason_to_refuse() -> None:
    """12 us late, which quiet sensors tell from a lag, move the live rate by a third of a percent of its peak."""
    assert reasons(SHORT, noise=QUIET) == (Reason.NONE,) * EVENTS


def test_a_channel_recorded_late_is_not_believed_with_quiet_sensors() -> None:
    assert set(reasons(LATE, noise=QUIET)) == {Reason.TIME_BASE}
