"""How many gaps a recording may have before what bridges them would be judged; a lift without a zero."""

from contextlib import nullcontext

import numpy as np
import pytest

from observer_rt.engine.signal_survey import Survey
from observer_rt.files.signals.doubts import doubts, refuse_perforated
from observer_rt.foundation.errors import UserError


@pytest.mark.parametrize(
    ("gaps", "length", "is_refused"), [(1, 3, False), (10, 1, False), (11, 1, True), (10, 90, False), (0, 0, False)]
)
def test_more_than_a_gap_in_a_hundred_samples_is_refused(gaps: int, length: int, is_refused: bool) -> None:
    values = np.ones(1000)
    for gap in range(gaps):
        values[gap * 91 : gap * 91 + length] = np.nan
    survey = Survey()
    survey.take("line_pressure", values)
    with pytest.raises(UserError, match=f"in {gaps} gaps") if is_refused else nullcontext():
        refuse_perforated(None, survey)


@pytest.mark.parametrize(("offset", "is_odd"), [(50e-6, True), (10e-6, False), (-30e-6, False)])
def test_a_lift_that_never_shuts_is_named(offset: float, is_odd: bool) -> None:
    """A database whose scale is half of the sender's shows it so."""
    survey = Survey()
    survey.take("needle_lift", np.repeat([0.0, 150e-6, 0.0], 100) + offset)
    assert [doubt.problem[:32] for doubt in doubts(survey)] == ["needle_lift is never below 50 um"] * is_odd
