"""Seat areas of a lift, its ramps extended to where the needle leaves its seat."""

from contextlib import nullcontext

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.core.identification.areas import fill_areas
from observer_rt.identification.likelihood.openings import opening_between
from observer_rt.model.effects import effective_model
from tests.identification.discovery.hidden import NOMINAL

SEAT = effective_model(NOMINAL).coefficients.seat


def _areas(lift: NDArray[np.float64], first: int, last: int, means: bool) -> NDArray[np.float64]:
    opening, area = opening_between(lift, first, last, 3), np.zeros(lift.size)
    ramps = np.array([[opening.rising.lift, opening.rising.slope, opening.falling.lift, opening.falling.slope]])
    fill_areas(lift, np.array([[first, last]]), ramps, 1.0, 0.0, 1.0, means, 1e-9, SEAT, area)
    return area


@pytest.mark.parametrize("means", [True, False])
@given(first=st.floats(1e-6, 40e-6), rises=st.lists(st.floats(5e-6, 60e-6), min_size=3, max_size=6))
def test_a_needle_shut_as_opened_has_a_mirrored_area(means: bool, first: float, rises: list[float]) -> None:
    """Of means, too: the first and last hold a part of a ramp, which the next one inwards tells."""
    flank = first + np.concatenate([[0.0], np.cumsum(rises)])
    lift = np.concatenate([np.zeros(30), flank, np.full(12, flank[-1]), 0.7 * flank[::-1], np.zeros(30)])
    begin, end = 30, lift.size - 31
    forwards, backwards = _areas(lift, begin, end, means), _areas(lift[::-1].copy(), begin, end, means)
    np.testing.assert_allclose(forwards, backwards[::-1], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("area", [9, 10])
@pytest.mark.parametrize("ramps", [(1, 3), (1, 4), (2, 4)])
@pytest.mark.parametrize("edges", [(1, 2), (1, 3), (2, 2)])
def test_tables_that_do_not_fit_are_refused(area: int, edges: tuple[int, int], ramps: tuple[int, int]) -> None:
    fits = area == 10 and edges[1] == 2 and ramps[1] == 4 and ramps[0] == edges[0]
    with nullcontext() if fits else pytest.raises(ValueError, match=r"do not fit|two ramps"):
        fill_areas(np.zeros(10), np.ones(edges, int), np.ones(ramps), 1, 0, 1, False, 0, SEAT, np.zeros(area))
