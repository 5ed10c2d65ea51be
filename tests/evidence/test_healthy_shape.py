"""The mean innovation of a healthy injector: found in noise, and the same at injections not seen."""

import numpy as np
import pytest

from observer_rt.evidence.healthy_shape import KNOTS, ShapeFit, expected, together
from observer_rt.evidence.measurement import Measurement, measurements
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.baseline import HealthyShape
from tests.discovery.hidden import recordings

FOUND = measurements(recordings(points=((60e6, 1.9e-3), (100e6, 0.6e-3), (140e6, 1.9e-3))))
SIGMA = 0.15 * MEGAPASCAL
TRUE = HealthyShape(
    opening=tuple((0.1 * np.sin(KNOTS / 60e-6) * np.exp(-KNOTS / 0.5e-3)).tolist()),
    opening_slope=tuple((0.05 * np.exp(-(((KNOTS - 0.2e-3) / 60e-6) ** 2))).tolist()),
    closing=tuple((-0.1 * np.exp(-np.abs(KNOTS) / 0.3e-3)).tolist()),
    closing_slope=(0.0,) * KNOTS.size,
)


def _noise(measurement: Measurement, seed: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.random.default_rng(seed).normal(size=expected(TRUE, measurement).size)


def test_the_shape_is_found_in_noise() -> None:
    seen = [
        (one, expected(TRUE, one) / SIGMA + 0.1 * _noise(one, number), SIGMA)
        for number, one in enumerate(FOUND)
    ]
    found = ShapeFit(seen).shape()
    for one in FOUND:
        true = expected(TRUE, one)
        left = expected(found, one) - true
        assert np.mean(left**2) < 0.1 * np.mean(true**2)


def test_what_was_left_out_is_not_seen() -> None:
    silent = [(one, np.zeros(expected(TRUE, one).size), SIGMA) for one in FOUND[:2]]
    loud = (FOUND[2], expected(TRUE, FOUND[2]) / SIGMA, SIGMA)
    fit = ShapeFit([*silent, loud])
    assert not any(fit.shape(left_out=2).opening)
    assert any(fit.shape().opening)


def test_shapes_add_up() -> None:
    both = together(TRUE, TRUE)
    assert expected(both, FOUND[0]) == pytest.approx(2.0 * expected(TRUE, FOUND[0]), abs=20.0)


def test_nothing_is_expected_long_before_and_after() -> None:
    one = FOUND[0]
    event = one.events[0]
    course = expected(TRUE, one)[: event.end - event.counted]
    samples = np.arange(event.counted, event.end)
    opening = event.openings[0]
    assert not course[samples < opening.first - 6].any()
    assert not course[samples > opening.last + 405].any()
    assert course[samples == opening.first + 10].any()
