"""What was learned at some operating points holds less at others."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.observer.learning.interval import REACH, EventPoint, remembered, unfamiliarity

points = st.builds(EventPoint, st.floats(0.1, 2.0), st.floats(-9.0, -5.0), st.floats(0.0, 1.0))


def test_nothing_is_known_before_the_first_event() -> None:
    assert unfamiliarity(EventPoint(1.0, -7.0, 1.0), ()) == 1.0


@given(points, st.lists(points, max_size=16), points)
def test_an_event_more_never_makes_a_point_stranger(
    point: EventPoint, learned_at: list[EventPoint], more: EventPoint
) -> None:
    before, after = unfamiliarity(point, learned_at), unfamiliarity(point, [*learned_at, more])
    assert 0.0 <= after <= before + 1e-9 <= 1.0 + 1e-9


def test_it_grows_with_the_distance_to_full() -> None:
    origin = EventPoint(1.0, -7.0, 0.8)
    away = np.array([unfamiliarity(EventPoint(1.0 + d * REACH[0], -7.0, 0.8), [origin]) for d in range(5)])
    assert np.all(np.diff(away) > 0.0)
    assert away[-1] == pytest.approx(1.0, abs=1e-3)


def test_repeated_events_leave_little_open() -> None:
    point = EventPoint(1.0, -7.0, 0.8)
    assert unfamiliarity(point, [point] * 10) < 0.2


def test_old_points_are_forgotten() -> None:
    far, near = EventPoint(0.4, -8.0, 0.2), EventPoint(1.6, -6.0, 1.0)
    learned_at: tuple[EventPoint, ...] = (far,)
    for _ in range(20):
        learned_at = remembered(learned_at, near)
    assert unfamiliarity(far, learned_at) > 0.99
