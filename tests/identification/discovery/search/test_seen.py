"""Laws are judged where recordings saw their inputs, and nowhere else."""

import pytest

from observer_rt.config.effects import term_domain
from observer_rt.foundation.errors import UserError
from observer_rt.identification.discovery.search.proposals import unsound
from observer_rt.identification.discovery.search.seen import seen_in
from observer_rt.identification.likelihood.measurement import measurements
from observer_rt.model.effects import effective_model
from observer_rt.model.terms.bounds import refuse_unbounded
from observer_rt.model.terms.parser import parse
from observer_rt.model.terms.term import Term, TermEquation
from observer_rt.model.terms.variable import Variable
from tests.identification.discovery.hidden import NOMINAL, recordings

SEEN = seen_in(measurements(recordings()), effective_model(NOMINAL))


@pytest.mark.parametrize(
    ("equation", "law"),
    [
        ("seat_flow", "-0.4*lift_rate"),  # of the whole flow at 2.5 mm/ms, which no needle here reaches
        ("stiffness", "-0.3*((line_pressure - 100)/50)^2"),
        ("line_flow", "-0.6*line_flow/60*abs(line_flow/60)*((line_pressure - 100)/50)"),
    ],
)
def test_a_law_is_sound_that_is_not_where_no_recording_was(equation: str, law: str) -> None:
    term = Term(TermEquation(equation), parse(law))
    with pytest.raises(UserError):
        refuse_unbounded(term, term_domain(NOMINAL))
    assert unsound([term], effective_model(NOMINAL), SEEN) is None


def test_a_law_that_is_unsound_where_it_was_seen_is_refused() -> None:
    term = Term(TermEquation.SEAT_FLOW, parse("-2*lift_rate"))
    refusal = unsound([term], effective_model(NOMINAL), SEEN)
    assert refusal is not None
    assert "1 + term is not above 0" in refusal.reason


def test_the_range_is_that_of_the_recordings() -> None:
    low, high = SEEN[Variable.RAIL_PRESSURE]
    assert low < 60.0 < 140.0 < high < 160.0
    low, high = SEEN[Variable.LIFT_RATE]
    assert -3.0 < low < -0.5
    assert 0.5 < high < 3.0
