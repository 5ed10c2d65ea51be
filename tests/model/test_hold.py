"""Inputs that bend between two samples: followed where they are said to."""

from itertools import pairwise

import numpy as np
import pytest

from observer_rt.config.bench import load_injector
from observer_rt.model.effective import coefficients
from observer_rt.model.network import constant_network
from observer_rt.model.stability import substeps_needed
from tests.intervals import Interval
from tests.model.conftest import advanced, advanced_over

NOMINAL = load_injector()
C = coefficients(NOMINAL)


@pytest.mark.parametrize("share", [0.15, 0.5, 0.8])
def test_a_bend_between_samples_is_followed(share: float) -> None:
    """The needle leaves its seat, and meets it, between samples of 50 us, as small steps alone would follow it."""
    interval, substeps = 5e-5, substeps_needed(NOMINAL, 20e3)
    for start, knot, end in ((-0.1, 0.05, 0.6), (0.6, 0.05, -0.1), (0.3, 0.9, 0.9)):
        u_start, u_end = (0.95, start), (0.95, end)
        x = (0.95, 0.0, 0.0) if start < 0.0 else (0.8, 0.6, 0.5)
        fine = x
        areas = np.interp(np.linspace(0.0, 1.0, 4001), [0.0, share, 1.0], [start, knot, end])
        for before, after in pairwise(float(area) for area in areas):
            fine = advanced(
                fine, Interval((0.95, before), (0.95, after), interval / 4000, 1), C, constant_network()
            )
        interval_of_sample = Interval(u_start, u_end, interval, substeps)
        bent = advanced_over(x, interval_of_sample, (share, knot), C, constant_network())
        straight = advanced(x, interval_of_sample, C, constant_network())
        assert bent == pytest.approx(fine, abs=1e-4)
        assert np.abs(np.subtract(straight, fine)).max() > 4e-3


def test_no_bend_changes_nothing() -> None:
    ends = (0.95, 0.2), (0.94, 0.5)
    interval_of_sample = Interval(*ends, 5e-5, 21)
    plain = advanced((0.8, 0.6, 0.5), interval_of_sample, C, constant_network())
    assert advanced_over((0.8, 0.6, 0.5), interval_of_sample, (0.0, 0.7), C, constant_network()) == plain
    on_the_line = advanced_over((0.8, 0.6, 0.5), interval_of_sample, (0.5, 0.35), C, constant_network())
    assert on_the_line == pytest.approx(plain, abs=1e-4)
