"""Notes on a lift while a file is looked through."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from observer_rt.engine.signal_survey import Survey


@given(
    lift=arrays(np.float64, st.integers(1, 80), elements=st.floats(-5e-6, 60e-6)),
    opens=st.floats(2e-6, 50e-6),
    cuts=st.lists(st.integers(1, 79), max_size=4),
)
def test_the_needle_never_opens_more_often_than_told(
    lift: np.ndarray[tuple[int], np.dtype[np.float64]], opens: float, cuts: list[int]
) -> None:
    survey = Survey()
    for part in np.split(lift, sorted(cuts)):
        survey.take("needle_lift", part)
    is_open, openings = False, 0
    for value in lift:
        openings += int(not is_open and value > opens)
        is_open = bool(value > (0.5 * opens if is_open else opens))
    assert openings <= survey.openings.most <= lift.size


def test_a_value_that_is_missing_is_no_movement() -> None:
    lift = np.tile([0.0, np.nan, 30e-6, np.nan, 200e-6, 0.0], 7)
    survey = Survey()
    survey.take("needle_lift", lift)
    assert survey.openings.most == 7
