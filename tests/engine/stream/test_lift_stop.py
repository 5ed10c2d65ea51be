"""How far the needle opens, from the openings that stay somewhere."""

import numpy as np
import pytest

from observer_rt.engine.stream.standstill import lift_figures
from tests.engine.sample_stream import NOISE, RAIL, Stream, stroke

STOP = 0.3e-3  # m


def figures(peaks: list[float], open_for: int = 110, drift: float = 0.0) -> tuple[float, bool]:
    """Lift at the stop and whether it is to scale, from openings that go so far [m]."""
    length = 2000 * (len(peaks) + 1)
    lift = np.random.default_rng(2).normal(0.0, NOISE.needle_lift, length)
    lift += drift * np.arange(length) / length
    for k, peak in enumerate(peaks):
        lift[1000 + 2000 * k :][:open_for] += stroke(open_for, peak)
    pressure = np.full(length, RAIL)
    result = lift_figures(Stream().feed(pressure, lift, pressure).observer, STOP)
    return result.at_stop, result.is_to_scale


@pytest.mark.parametrize(("factor", "is_to_scale"), [(1.0, True), (1.02, True), (1.05, False), (0.95, False)])
def test_scale_at_the_stop(factor: float, is_to_scale: bool) -> None:
    at_stop, is_reported_to_scale = figures([factor * STOP] * 8, drift=10e-6)
    assert at_stop == pytest.approx(factor * STOP, rel=0.003)
    assert is_reported_to_scale is is_to_scale


def test_ballistic_openings_tell_nothing_of_the_stop() -> None:
    at_stop, is_reported_to_scale = figures([0.1e-3] * 8, open_for=40)  # up and down, nowhere still
    assert np.isnan(at_stop)
    assert is_reported_to_scale


def test_openings_that_stay_lower_do_not_count() -> None:
    at_stop, _ = figures([0.1e-3, STOP, 0.15e-3, STOP, STOP, STOP, 0.12e-3, STOP, STOP])
    assert at_stop == pytest.approx(STOP, rel=0.003)


def test_a_few_openings_are_not_enough() -> None:
    assert np.isnan(figures([STOP] * 3)[0])
