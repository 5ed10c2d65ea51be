"""Letters of the page: old numbers are told from new ones, and nothing says the same twice."""

import math
from dataclasses import replace

import numpy as np
import pytest

from observer_rt.bus.mapping.output_signals import StatusValues, SummaryValues
from observer_rt.desk.live_page.injector import HISTORY, Fault, Seen
from observer_rt.desk.live_page.page.letters import banner_html, numbers_html
from observer_rt.desk.live_page.samples import SeenInjection
from observer_rt.engine.stream.state import State

SECOND = 1_000_000_000
SHOWN = SeenInjection(SummaryValues._make([1] * len(SummaryValues._fields)), 100 * SECOND)
SEEN = Seen("", (SHOWN,), np.empty(0, HISTORY), None, (), 0)


@pytest.mark.parametrize(
    ("age", "text", "is_old"), [(0, "0 s ago", False), (3, "3 s ago", True), (180, "3 min", True)]
)
def test_numbers_say_their_age_and_are_pale_when_old(age: int, text: str, is_old: bool) -> None:
    html = numbers_html(SEEN, (100 + age) * SECOND)
    assert text in html
    assert ("numbers old" in html) == is_old


def test_a_mass_that_is_not_known_is_said_in_words() -> None:
    unknown = replace(SHOWN, summary=SHOWN.summary._replace(mass=math.nan))
    html = numbers_html(replace(SEEN, injections=(unknown,)), 100 * SECOND)
    assert "not known" in html
    assert "nan" not in html


def test_a_fault_lists_the_messages_it_shows_in() -> None:
    fault = Fault(
        "no frame of any input for 3 s", 0, "the device", ("Lift: no frame for 3 s", "Line: no frame for 4 s")
    )
    html = banner_html(replace(SEEN, faults=(fault,)))
    assert html.count('class="fault"') == 1
    assert html.count("<li>") == 2
    assert "no fault" not in html


def status_of(state: State) -> StatusValues:
    """An observer that says no more than its state."""
    return StatusValues._make([0] * len(StatusValues._fields))._replace(state=state)


def test_what_an_observer_said_before_it_fell_silent_is_not_its_state() -> None:
    said = replace(SEEN, status=status_of(State.ADAPTED))
    assert "ADAPTED" in banner_html(said)
    assert "no fault" in banner_html(said)
    silent = replace(said, faults=(Fault("no frame", 0, "start it"),), silent_since=0)
    html = banner_html(silent)
    assert "OBSERVER SILENT" in html
    assert "ADAPTED" not in html
    assert "numbers old" in numbers_html(silent, SHOWN.moment)


def test_only_a_good_state_without_a_fault_is_said_to_have_none() -> None:
    for state in (State.STARTING, State.WAITING_FOR_DATA, State.DEGRADED):
        assert "no fault" not in banner_html(replace(SEEN, status=status_of(state)))
    assert "no fault" not in banner_html(SEEN)


@pytest.mark.parametrize("faults", [(), (Fault("no frame", 0, "start it"),)])
def test_what_has_ended_is_neither_good_nor_is_its_fault_forgotten(faults: tuple[Fault, ...]) -> None:
    html = banner_html(replace(SEEN, status=status_of(State.ADAPTED), faults=faults), is_over=True)
    assert 'class="state good"' not in html
    assert ('class="state bad"' in html) == bool(faults)
