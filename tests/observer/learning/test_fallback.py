"""When what was learned is set aside, and when learning stops."""

from observer_rt.estimation.phases import Phase
from observer_rt.observer.learning.adequacy import Objection
from observer_rt.observer.learning.fallback import Freezer, Mistrust
from observer_rt.observer.stream.state import Reason
from tests.observer.learning.test_adequacy import statistics_of


def test_learning_freezes_after_two_bad_standstills_and_goes_on_after_three_good_ones() -> None:
    bad, good = (statistics_of(colour, 1.0, 1e3, Phase.STANDSTILL) for colour in (3.0, 1.0))
    open_phase = statistics_of(3.0, 1.0, 1e3, Phase.OPEN)
    freezer = Freezer()
    events = [bad, good, open_phase, bad, bad, good, good, bad, good, good, good, bad, good]
    frozen = [freezer.is_frozen_after(statistics) for statistics in events]
    assert frozen == [False] * 4 + [True] * 6 + [False] * 3


def doubts(*reasons: Reason | None) -> list[Reason | None]:
    """Why what was learned is set aside after each of the events; None as a reason: it passed."""
    mistrust = Mistrust()
    found = [mistrust.after([] if r is None else [Objection(r)]) for r in reasons]
    return [None if objection is None else objection.reason for objection in found]


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


def test_a_scale_that_is_not_known_is_doubted_at_once() -> None:
    assert doubts(Reason.AMBIGUOUS_SCALE) == [Reason.AMBIGUOUS_SCALE]
