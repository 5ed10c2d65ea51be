"""Letters of the page: old numbers are told from new ones, and nothing says the same twice."""

import math
from dataclasses import replace

import numpy as np
import pytest

from observer_rt.bus.mapping.output_messages import SummaryValues
from observer_rt.watch.injector import HISTORY, Fault, Seen
from observer_rt.watch.page.session import banner_html
from observer_rt.watch.samples import SeenInjection

SECOND = 1_000_000_000
SHOWN = SeenInjection(SummaryValues._make([1] * len(SummaryValues._fields)), 100 * SECOND)
SEEN = Seen("", (SHOWN,), np.empty(0, HISTORY), None, (), 0)


@pytest.mark.parametrize(
    ("age", "text", "is_old"), [(0, "0 s ago", False), (3, "3 s ago", True), (180, "3 min", True)]
)
def test_numbers_say_their_age_and_are_pale_when_old(age: int, text: str, is_old: bool) -> None:
    html = banner_html(SEEN, SHOWN, (100 + age) * SECOND)
    assert text in html
    assert ("numbers old" in html) == is_old


def test_a_mass_that_is_not_known_is_said_in_words() -> None:
    unknown = replace(SHOWN, summary=SHOWN.summary._replace(mass=math.nan))
    html = banner_html(SEEN, unknown, 100 * SECOND)
    assert "not known" in html
    assert "nan" not in html


def test_a_fault_lists_the_messages_it_shows_in() -> None:
    fault = Fault(
        "no frame of any input for 3 s", 0, "the device", ("Lift: no frame for 3 s", "Line: no frame for 4 s")
    )
    html = banner_html(replace(SEEN, faults=(fault,)), SHOWN, 100 * SECOND)
    assert html.count('class="fault"') == 1
    assert html.count("<li>") == 2
    assert "no fault" not in html
