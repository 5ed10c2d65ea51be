"""Validity: the first fact in the order of docs/validity.md decides; a fact still unknown degrades nothing."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.core.stream.stream import reason_and_state
from observer_rt.engine.stream.state import Doubt, Reason, State
from observer_rt.engine.stream.validity import ServiceCondition, contested, reason_of_injection, state_of_service

WELL = {
    "unsynchronised_by": 0,
    "is_synchronised": True,
    "doubt": 0,
    "input_fault": 0,
    "is_lift_beyond": False,
    "is_lift_dead": False,
    "events": 2,
    "events_required": 2,
    "is_in_learned_range": True,
    "judgement": 0,
    "is_contradicted": False,
    "has_learned": True,
    "is_preliminary": False,
}
SETTLES = [Reason.STARTING, Reason.JUMPED, Reason.SAMPLES_LOST, Reason.NEEDLE_STUCK]
IN_ORDER: list[tuple[dict[str, int], Reason]] = [
    ({"is_synchronised": False, "unsynchronised_by": Reason.SAMPLES_LOST}, Reason.SAMPLES_LOST),
    ({"doubt": Doubt.FROZEN}, Reason.INPUT_FROZEN),
    ({"input_fault": Reason.TIME_BASE}, Reason.TIME_BASE),
    ({"is_lift_beyond": True}, Reason.LIFT_ZERO),
    ({"is_lift_dead": True}, Reason.LIFT_DEAD),
    ({"judgement": Reason.MODEL_INADEQUATE}, Reason.MODEL_INADEQUATE),
    ({"events": 1}, Reason.TOO_FEW_EVENTS),
    ({"is_contradicted": True}, Reason.CONTRADICTED),
    ({"is_in_learned_range": False}, Reason.OUTSIDE_LEARNED_RANGE),
    ({"is_preliminary": True}, Reason.PRELIMINARY),
]


def of_sample(**facts: int) -> tuple[Reason, State]:
    reason, state = reason_and_state(WELL | facts)
    return Reason(reason), State(state)


@given(st.lists(st.sampled_from(range(len(IN_ORDER))), unique=True))
def test_of_several_reasons_the_first_in_order(chosen: list[int]) -> None:
    facts: dict[str, int] = {}
    for number in chosen:
        facts |= IN_ORDER[number][0]
    reason, state = of_sample(**facts)
    assert reason is (IN_ORDER[min(chosen)][1] if chosen else Reason.NONE)
    not_known_yet = {6, 7, 8, 9} if 6 in chosen else {8, 9}  # what too few events cannot contradict
    assert (state is State.DEGRADED) == bool(set(chosen) - not_known_yet)


@pytest.mark.parametrize("reason", SETTLES)
def test_until_it_has_settled_nothing_is_valid(reason: Reason) -> None:
    result, state = of_sample(is_synchronised=False, unsynchronised_by=reason)
    assert result is reason
    expected = {Reason.STARTING: State.STARTING, Reason.JUMPED: State.ADAPTED}
    assert state is expected.get(reason, State.DEGRADED)


def test_before_anything_is_learned_it_runs_nominal() -> None:
    assert of_sample(has_learned=False) == (Reason.NONE, State.RUNNING_NOMINAL)


NONE = Reason.NONE


@pytest.mark.parametrize(
    ("facts", "reason"),
    [
        ((NONE, NONE, NONE, False), NONE),
        ((NONE, Reason.MODEL_INADEQUATE, NONE, False, True), Reason.MODEL_INADEQUATE),
        ((Reason.CONTRADICTED, Reason.SUDDEN_CHANGE, NONE, False), Reason.SUDDEN_CHANGE),
        ((Reason.CONTRADICTED, NONE, NONE, True), NONE),
        ((Reason.CONTRADICTED, NONE, NONE, False), Reason.CONTRADICTED),
        ((Reason.CONTRADICTED, NONE, NONE, False, True), NONE),
        ((Reason.TOO_FEW_EVENTS, NONE, NONE, False), Reason.TOO_FEW_EVENTS),
        ((Reason.TOO_FEW_EVENTS, NONE, NONE, False, True), NONE),
        ((Reason.OUTSIDE_LEARNED_RANGE, Reason.LIFT_SENSOR_LAG, NONE, False, True), Reason.LIFT_SENSOR_LAG),
        ((Reason.LIFT_SENSOR_LAG, NONE, NONE, False, True), NONE),
        ((Reason.SAMPLES_LOST, Reason.NOT_LEARNED, NONE, False), Reason.SAMPLES_LOST),
        ((Reason.INPUT_FROZEN, NONE, NONE, False, True), Reason.INPUT_FROZEN),
        ((NONE, Reason.NOT_JUDGED, Reason.INPUT_FROZEN, False), Reason.INPUT_FROZEN),
        ((NONE, NONE, Reason.INPUT_FROZEN, False, True), Reason.INPUT_FROZEN),
        ((Reason.LEARNING_LATE, NONE, NONE, False, True), NONE),
        ((Reason.TOO_FEW_EVENTS, NONE, Reason.INPUT_CLIPPED, False), Reason.INPUT_CLIPPED),
    ],
)
def test_the_verdict_may_know_better_than_the_samples(facts: tuple[Any, ...], reason: Reason) -> None:
    assert reason_of_injection(*facts) is reason


def test_links_go_before_inputs_and_inputs_before_samples() -> None:
    newest = (State.ADAPTED, NONE)
    assert state_of_service(newest, ServiceCondition()) == newest
    assert state_of_service(None, ServiceCondition()) == (State.STARTING, Reason.STARTING)
    assert state_of_service(newest, ServiceCondition(is_stale=True)) == (State.DEGRADED, Reason.INPUT_STALE)
    cut_off = ServiceCondition(is_cut_off=True, is_stale=True)
    assert state_of_service(newest, cut_off) == (State.WAITING_FOR_DATA, Reason.INPUT_TIMEOUT)
    silent = ServiceCondition(has_frames=False, is_cut_off=True)
    assert state_of_service(None, silent) == (State.WAITING_FOR_DATA, Reason.STARTING)


@given(st.sampled_from(State), st.sampled_from(Reason))
def test_beside_a_second_sender_nothing_is_valid(state: State, reason: Reason) -> None:
    result, reasons = contested(state, reason)
    assert result in (State.DEGRADED, State.WAITING_FOR_DATA)
    assert Reason.SECOND_SENDER in reasons
    assert reason is NONE or reason in reasons
    assert NONE not in reasons
