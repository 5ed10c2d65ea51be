"""The lagging sensor, and inputs that bend between two samples, against other methods."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from observer_rt.config.bench import load_injector
from observer_rt.core.model.laws import lagged, lagged_slopes
from observer_rt.model.effective import coefficients
from observer_rt.model.network import constant_network
from observer_rt.model.stability import substeps_needed
from tests.intervals import Interval
from tests.model.conftest import advanced

INTERVAL = 1e-5  # s
pressures = st.floats(-0.1, 2.0)

NOMINAL = load_injector()
C = coefficients(NOMINAL)


def solved(indicated: float, start: float, end: float, interval: float, lag: float) -> float:
    """tau y' = p - y with p a ramp, by an implicit method with tight tolerances."""
    solution = solve_ivp(
        lambda t, y: (start + (end - start) * t / interval - y) / lag,
        (0.0, interval),
        [indicated],
        method="Radau",
        rtol=1e-10,
        atol=1e-12,
    )
    return float(solution.y[0, -1])


@pytest.mark.parametrize("interval", [1e-5, 5e-5])
@pytest.mark.parametrize("lag", [2e-7, 3e-6, 40e-6, 500e-6])
@pytest.mark.parametrize(("indicated", "start", "end"), [(0.9, 0.95, 0.7), (1.0, 1.0, 1.2), (0.3, 0.1, 0.1)])
def test_lagged_solves_its_equation(interval: float, lag: float, indicated: float, start: float, end: float) -> None:
    expected = solved(indicated, start, end, interval, lag)
    assert lagged(indicated, start, end, interval, lag) == pytest.approx(expected, abs=1e-8)


@given(pressures, pressures, pressures)
def test_without_a_lag_the_pressure_is_indicated(indicated: float, start: float, end: float) -> None:
    assert lagged(indicated, start, end, INTERVAL, 0.0) == end


def test_no_jump_where_the_lag_becomes_negligible() -> None:
    """Below a thousandth of a sample another formula is used."""
    edge = 1e-3 * INTERVAL
    below, above = (lagged(0.5, 0.9, 0.8, INTERVAL, edge * share) for share in (1 - 1e-9, 1 + 1e-9))
    assert below == pytest.approx(above, abs=1e-12)


@given(pressures, pressures, pressures, st.one_of(st.floats(2e-7, 5e-4), st.floats(1e-9, 5e-9)))
def test_slopes_are_the_derivatives(indicated: float, start: float, end: float, lag: float) -> None:
    point = np.array([indicated, start, end, lag])
    slopes = lagged_slopes(indicated, start, end, INTERVAL, lag)
    for i, slope in enumerate(slopes):
        step = np.zeros(4)
        step[i] = 1e-3 * lag if i == 3 else 1e-4
        high, low = (point + step), (point - step)
        numeric = (
            lagged(high[0], high[1], high[2], INTERVAL, high[3]) - lagged(low[0], low[1], low[2], INTERVAL, low[3])
        ) / (2 * step[i])
        scale = 1.0 if i < 3 else 1.0 / max(lag, INTERVAL)
        assert slope == pytest.approx(numeric, rel=1e-4, abs=1e-5 * scale)


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
            fine = advanced(fine, Interval((0.95, before), (0.95, after), interval / 4000, 1), C, constant_network())
        interval_of_sample = Interval(u_start, u_end, interval, substeps)
        bent = advanced(x, interval_of_sample, C, constant_network(), (share, knot))
        straight = advanced(x, interval_of_sample, C, constant_network())
        assert bent == pytest.approx(fine, abs=1e-4)
        assert np.abs(np.subtract(straight, fine)).max() > 4e-3


def test_no_bend_changes_nothing() -> None:
    interval_of_sample = Interval((0.95, 0.2), (0.94, 0.5), 5e-5, 21)
    plain = advanced((0.8, 0.6, 0.5), interval_of_sample, C, constant_network())
    assert advanced((0.8, 0.6, 0.5), interval_of_sample, C, constant_network(), (0.0, 0.7)) == plain
    on_the_line = advanced((0.8, 0.6, 0.5), interval_of_sample, C, constant_network(), (0.5, 0.35))
    assert on_the_line == pytest.approx(plain, abs=1e-4)
