"""When what was learned is set aside, when learning stops, and when what was believed before is believed again."""

from dataclasses import replace

import numpy as np
import pytest

from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.engine.estimation.gating import prior_belief
from observer_rt.engine.estimation.phases import Phase, no_statistics
from observer_rt.engine.learning.adequacy import SETTLED, Objection
from observer_rt.engine.learning.disturbances.colour import RestingNoise
from observer_rt.engine.learning.disturbances.pressure_gains import PressureGains
from observer_rt.engine.learning.fallback import (
    CHANGES,
    RECOVERED,
    RELAPSES,
    Freezer,
    Mistrust,
    Relapses,
)
from observer_rt.engine.learning.state import Checkpoint, LearnedInjector
from observer_rt.engine.stream.state import Reason
from tests.engine.learning.test_adequacy import statistics_of
from tests.engine.learning.worn_injector import recorded
from tests.observed_plants import bench_at, recording_of
from tests.plants.plant import Measured, event_start


def test_learning_freezes_after_two_bad_standstills_and_goes_on_after_three_good_ones() -> None:
    bad, good = (statistics_of(colour, 1.0, 1e3, Phase.STANDSTILL) for colour in (3.0, 1.0))
    open_phase = statistics_of(3.0, 1.0, 1e3, Phase.OPEN)
    freezer = Freezer()
    events = [bad, good, open_phase, bad, bad, good, good, bad, good, good, good, bad, good]
    frozen = []
    for statistics in events:
        freezer = freezer.after(statistics)
        frozen.append(freezer.frozen)
    assert frozen == [False] * 4 + [True] * 6 + [False] * 3


def doubts(*reasons: Reason | None) -> list[Reason | None]:
    """Why what was learned is set aside after each of the events; None as a reason: it passed."""
    mistrust, found = Mistrust(), list[Reason | None]()
    for reason in reasons:
        mistrust = mistrust.after([] if reason is None else [Objection(reason)])
        found.append(None if mistrust.objection is None else mistrust.objection.reason)
    return found


BAD, CHANGE, OFFSET = Reason.MODEL_INADEQUATE, Reason.SUDDEN_CHANGE, Reason.PRESSURE_OFFSET


def test_one_change_is_no_doubt_but_changes_all_the_time_are() -> None:
    assert doubts(CHANGE, None, None, CHANGE, None) == [None] * 5
    assert doubts(CHANGE, CHANGE) == [None, CHANGE]
    # what is named and corrected neither raises nor removes doubt
    assert doubts(OFFSET, OFFSET, OFFSET) == [None] * 3
    assert doubts(CHANGE, OFFSET, CHANGE, OFFSET) == [None, None, CHANGE, CHANGE]


def test_doubt_ends_when_two_events_in_a_row_passed() -> None:
    assert doubts(BAD, BAD, None, BAD, None, None) == [None, BAD, BAD, BAD, BAD, None]
    assert doubts(BAD, BAD, None, None, BAD) == [None, BAD, BAD, None, None]


def test_changes_that_do_not_end_are_a_model_that_does_not_fit() -> None:
    """Though some operating points contradict it less, and events there pass."""
    found = doubts(*[CHANGE, None, CHANGE] * CHANGES)
    assert found[:8] == [None] * 3 + [CHANGE] * 5
    assert set(found[2 * CHANGES :]) == {BAD}
    assert doubts(*[CHANGE, CHANGE, None, None] * CHANGES)[-4:] == [None, CHANGE, CHANGE, None]


def test_a_scale_that_is_not_known_is_doubted_at_once() -> None:
    assert doubts(Reason.AMBIGUOUS_SCALE) == [Reason.AMBIGUOUS_SCALE]


def relapsed(*reasons: Reason | None) -> list[bool]:
    """Whether the model is wrong after each of the events; None as a reason: it passed."""
    relapses, found = Relapses(), list[bool]()
    for reason in reasons:
        relapses = relapses.after([] if reason is None else [Objection(reason)])
        found.append(relapses.last)
    return found


def test_a_model_contradicted_again_and_again_is_wrong_where_it_passes_too() -> None:
    """Until it passes for long: the operating points that contradict it may be seldom."""
    found = relapsed(*[None, BAD] * RELAPSES, *[None] * RECOVERED)
    assert found == [False] * (2 * RELAPSES - 1) + [True] * RECOVERED + [False]


def test_a_fault_that_passes_is_no_relapse() -> None:
    """Neither one that lasts, nor several far apart, nor what is named."""
    assert not any(relapsed(*[BAD] * 20, None, None))
    assert not any(relapsed(*[*[BAD] * 3, *[None] * RECOVERED] * 2 * RELAPSES))
    assert not any(relapsed(*[None, OFFSET] * 2 * RELAPSES))


def checkpoint_after(passed: list[bool]) -> Checkpoint:
    """Events, numbered from 1 on; what is believed after each is its number."""
    checkpoint = Checkpoint()
    for number, each in enumerate(passed, 1):
        theta = np.full(2, float(number))
        belief = prior_belief(theta, np.eye(2))
        learned = LearnedInjector(belief, theta, no_statistics(), frozenset({1}), is_prior=False)
        gains, at_rest = PressureGains(difference=1e-3 * number), RestingNoise(count=float(number))
        checkpoint = checkpoint.after(learned, gains, at_rest, each)
    return checkpoint


def test_what_was_believed_is_kept_until_enough_events_passed_in_a_row() -> None:
    trouble = [True] * SETTLED + [False, False]
    for passed, kept in (
        (trouble, SETTLED),
        (trouble + [True] * (SETTLED - 1), SETTLED),
        (trouble + [True] * SETTLED, 2 * SETTLED + 2),
    ):
        checkpoint = checkpoint_after(passed)
        assert checkpoint.learned is not None
        assert (checkpoint.learned.theta[0], checkpoint.learned.belief.mean[0]) == (kept, kept)
        assert checkpoint.learned.active == {1}
        assert checkpoint.gains.difference == 1e-3 * kept
        assert checkpoint.at_rest.count == kept


def test_it_is_tried_while_a_trouble_lasts() -> None:
    assert not checkpoint_after([]).is_worth_trying
    assert not checkpoint_after([False] * 3).is_worth_trying  # there is none
    settled = [True] * SETTLED
    assert not checkpoint_after([*settled[1:], False]).is_worth_trying
    assert not checkpoint_after(settled).is_worth_trying
    assert all(checkpoint_after(settled + [False] * n).is_worth_trying for n in range(1, 30))
    assert not checkpoint_after([*settled, False, True]).is_worth_trying


EVENTS, FIRST, LAST = 15, 6, 8  # events, and those within which a sensor is wrong


def rail_steps(measured: Measured, during: np.ndarray) -> Measured:
    return replace(measured, rail_pressure=measured.rail_pressure + 3e6 * during)


def line_in_another_unit(measured: Measured, during: np.ndarray) -> Measured:
    return replace(measured, line_pressure=np.where(during, 0.1, 1.0) * measured.line_pressure)


def swapped(measured: Measured, during: np.ndarray) -> Measured:
    rail, line = measured.rail_pressure, measured.line_pressure
    return replace(
        measured, rail_pressure=np.where(during, line, rail), line_pressure=np.where(during, rail, line)
    )


@pytest.mark.parametrize("fault", [rail_steps, line_in_another_unit, swapped])
def test_after_a_fault_the_third_injection_is_valid_and_right(fault) -> None:  # type: ignore[no-untyped-def]
    outcome = recorded(EVENTS, 4)
    time = outcome.measured.time
    during = (time >= event_start(FIRST) - 0.02) & (time < event_start(LAST) + 0.02)
    recording = recording_of(replace(outcome, measured=fault(outcome.measured, during)))
    found = evaluate(bench_at(100e3), [recording]).evaluations[0].reports
    plain = evaluate(bench_at(100e3), [recording_of(outcome)]).evaluations[0].reports
    assert not any(report.valid for report in found[FIRST : LAST + 1])
    assert all(report.valid for report in found[LAST + 3 :])
    assert [report.mass for report in found[LAST + 3 :]] == pytest.approx(
        [report.mass for report in plain[LAST + 3 :]], rel=0.01
    )
