"""Mean innovation of a healthy injector: as recorded lifts have it, and moved with a needle that answers commands."""

import numpy as np
import pytest

from observer_rt.config.bench import load_injector
from observer_rt.engine.estimation.parameters import NEEDLE_LAW, PARAMETERS, learned_of
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.healthy import KNOTS, EventStretch, expected, expected_in, needle_course
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.baseline import HealthyShape
from tests.differences import Array, assert_columns_agree, differences
from tests.engine.conftest import Case, event_inputs, simulated_event, worn_theta

SHAPE = HealthyShape(
    opening=tuple((0.1 * np.maximum(KNOTS, 0.0) / 60e-6 * np.exp(-KNOTS / 0.2e-3)).tolist()),
    opening_slope=tuple((0.05 * np.exp(-(((KNOTS - 0.2e-3) / 60e-6) ** 2))).tolist()),
    closing=tuple((-0.1 * np.exp(-(((KNOTS - 0.2e-3) / 0.1e-3) ** 2))).tolist()),
    closing_slope=(0.0,) * KNOTS.size,
)
NEEDLE = NEEDLE_LAW.columns
MOVED = np.zeros(PARAMETERS)
MOVED[NEEDLE[:4]] = 0.2, 0.1, -0.3, -0.1
SHOTS = {"stop": [(80.0, 190.0)], "ballistic": [(80.0, 120.0), (230.0, 245.0)], "none": [(80.0, 81.0)]}


def stretch(rail_pressure: float, opens: float, shuts: float) -> EventStretch:
    """Eight milliseconds round one opening; rail_pressure [MPa]."""
    return EventStretch(800, 10e-6, rail_pressure * MEGAPASCAL, ((opens, shuts),))


def commanded_window(case: Case, shots: str) -> Window:
    window = simulated_event(case, worn_theta(seed=7), event_inputs(rail=0.7), seed=3)
    return window._replace(needle=load_injector().needle_law, commands=np.array(SHOTS[shots]))


def test_the_courses_of_all_openings_add_up() -> None:
    both = stretch(60, 100.0, 150.0)._replace(openings=((100.0, 150.0), (300.0, 420.0)))
    alone = [both._replace(openings=(opening,)) for opening in both.openings]
    assert expected(SHAPE, both) == pytest.approx(sum(expected(SHAPE, one) for one in alone))


def test_nothing_is_expected_long_before_and_after() -> None:
    course = expected(SHAPE, stretch(100, 100.0, 160.0))
    assert not course[: 100 - 4].any()
    assert not course[160 + 401 :].any()
    assert course[110] != 0.0


def test_a_needle_by_commands_has_the_course_of_its_lift(case: Case) -> None:
    """Up to what rounded corners move an edge."""
    window, learned = commanded_window(case, "stop"), learned_of(MOVED, case.c)
    lifted = window.as_learned(learned, case.setting)._replace(needle=None)
    by_lift = expected_in(SHAPE, lifted, case.c, case.setting.interval)
    by_needle = needle_course(SHAPE, window, learned, case.setting).expected
    assert np.abs(by_needle).max() > 5e-4
    assert np.linalg.norm(by_needle - by_lift) < 0.1 * np.linalg.norm(by_needle)


def test_a_needle_that_does_not_lift_has_none(case: Case) -> None:
    course = needle_course(SHAPE, commanded_window(case, "none"), learned_of(MOVED, case.c), case.setting)
    assert not any(part.any() for part in course)


@pytest.mark.parametrize("shots", ["stop", "ballistic"])
def test_slopes_are_the_derivatives_by_needle_and_shots(case: Case, shots: str) -> None:
    """Nearly, for the course has corners."""
    window, step = commanded_window(case, shots), 0.005

    def course(needle: Array) -> Array:
        moved = MOVED.copy()
        moved[NEEDLE] = needle
        return needle_course(SHAPE, window, learned_of(moved, case.c), case.setting).expected

    def late(delays: Array) -> Array:
        shifted = window.with_jitter(delays * NEEDLE_LAW.sizes[0], case.setting.interval)
        return needle_course(SHAPE, shifted, learned_of(MOVED, case.c), case.setting).expected

    here = needle_course(SHAPE, window, learned_of(MOVED, case.c), case.setting)
    assert_columns_agree(here.by_numbers, differences(course, MOVED[NEEDLE], step), 0.2)
    assert_columns_agree(here.by_shots, differences(late, np.zeros(window.shot_columns), step), 0.2)
