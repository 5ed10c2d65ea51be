"""The mean innovation of a healthy injector: found in noise, and the same at injections not seen."""

import numpy as np
import pytest

from observer_rt.engine.learning.healthy import KNOTS, EventStretch, ShapeFit, expected, together
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.baseline import HealthyShape

SIGMA = 0.15 * MEGAPASCAL
INTERVAL = 10e-6
TRUE = HealthyShape(
    opening=tuple((0.1 * np.sin(KNOTS / 60e-6) * np.exp(-KNOTS / 0.5e-3)).tolist()),
    opening_slope=tuple((0.05 * np.exp(-(((KNOTS - 0.2e-3) / 60e-6) ** 2))).tolist()),
    closing=tuple((-0.1 * np.exp(-np.abs(KNOTS) / 0.3e-3)).tolist()),
    closing_slope=(0.0,) * KNOTS.size,
)


def stretch(rail_pressure: float, opens: float, shuts: float) -> EventStretch:
    """Eight milliseconds round one opening; rail_pressure [MPa]."""
    return EventStretch(800, INTERVAL, rail_pressure * MEGAPASCAL, ((opens, shuts),))


RECORDINGS = [
    [stretch(pressure, 100.0 + phase, 100.0 + phase + open_for) for phase in np.linspace(0.0, 0.9, 8)]
    for pressure, open_for in ((60, 190), (100, 60), (140, 190))
]


def test_the_shape_is_found_in_noise() -> None:
    random = np.random.default_rng(0)
    seen = [
        [
            (
                stretch_of_event,
                expected(TRUE, stretch_of_event) / SIGMA + 0.1 * random.normal(size=stretch_of_event.samples),
            )
            for stretch_of_event in events
        ]
        for events in RECORDINGS
    ]
    result = ShapeFit(seen, SIGMA).shape()
    for stretch_of_event in (stretch(80, 120.3, 220.7), stretch(120, 99.9, 260.2)):
        true = expected(TRUE, stretch_of_event)
        assert np.mean((expected(result, stretch_of_event) - true) ** 2) < 0.1 * np.mean(true**2)


def test_what_was_left_out_is_not_seen() -> None:
    silent = [[(one, np.zeros(one.samples)) for one in events] for events in RECORDINGS[:2]]
    loud = [(one, expected(TRUE, one) / SIGMA) for one in RECORDINGS[2]]
    fit = ShapeFit([*silent, loud], SIGMA)
    assert not any(fit.shape(left_out=2).opening)
    assert any(fit.shape().opening)


def test_shapes_add_up() -> None:
    recording_stretch = RECORDINGS[0][0]
    assert expected(together(TRUE, TRUE), recording_stretch) == pytest.approx(
        2.0 * expected(TRUE, recording_stretch), abs=20.0
    )


def test_the_courses_of_all_openings_add_up() -> None:
    both = RECORDINGS[0][0]._replace(openings=((100.0, 150.0), (300.0, 420.0)))
    alone = [both._replace(openings=(opening,)) for opening in both.openings]
    assert expected(TRUE, both) == pytest.approx(sum(expected(TRUE, one) for one in alone))


def test_nothing_is_expected_long_before_and_after() -> None:
    outside_stretch = stretch(100, 100.0, 160.0)
    course = expected(TRUE, outside_stretch)
    assert not course[: 100 - 4].any()
    assert not course[160 + 401 :].any()
    assert course[110] != 0.0
