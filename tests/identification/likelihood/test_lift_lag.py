"""A lift recorded by a slow sensor, restored."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.desk.simulation.simulate import shown_slowly
from observer_rt.identification.likelihood.measurement import Measurement, measurements
from observer_rt.identification.likelihood.openings import (
    GRID,
    find_openings,
    openings_without_lag,
    without_lag,
)
from observer_rt.identification.likelihood.windows import TrueInputs
from observer_rt.model.effective import InputTerms
from observer_rt.model.effects import effective_model, sized
from tests.identification.discovery.hidden import NOMINAL, recordings

RATE, NOISE = 100e3, 0.4e-6
C = effective_model(NOMINAL).coefficients


def _stroke(samples: int = 1000) -> NDArray[np.float64]:
    """Off the seat at sample 200.4, shut at 390.7, with flanks of 8 um a sample."""
    k = np.arange(samples, dtype=np.float64)
    return np.clip(8e-6 * np.minimum(k - 200.4, 390.7 - k), 0.0, 300e-6)


@pytest.mark.parametrize("lag", [5e-6, 16e-6, 60e-6])
def test_a_lift_is_restored_and_opens_when_it_did(lag: float) -> None:
    true = _stroke()
    noise = NOISE * np.random.default_rng(1).normal(size=true.size)
    recorded = shown_slowly(true, 1.0 / RATE, lag) + noise
    restored = without_lag(recorded, RATE, lag)
    around = openings_without_lag(recorded, NOISE, find_openings(recorded, NOISE), RATE, lag)
    assert sum(share for share, _ in around) == pytest.approx(1.0)
    _, (opening,) = max(around, key=lambda one: one[0])
    (straight,) = find_openings(true + noise, NOISE)
    louder = NOISE * np.hypot(1.0, lag * RATE)
    assert np.abs(restored - true).max() < 4.5 * louder
    for item, wanted in ((opening.rising, straight.rising), (opening.falling, straight.falling)):
        assert item.slope == pytest.approx(wanted.slope, rel=0.08)
    opens = opening.first - opening.rising.lift / opening.rising.slope
    shuts = opening.last + opening.falling.lift / opening.falling.slope
    assert (opens, shuts) == pytest.approx((200.4, 390.7), abs=0.4)


def test_noise_behind_the_end_is_no_opening() -> None:
    rng = np.random.default_rng(2)
    recorded = shown_slowly(_stroke(100_000), 1.0 / RATE, 60e-6) + NOISE * rng.normal(size=100_000)
    around = openings_without_lag(recorded, NOISE, find_openings(recorded, NOISE), RATE, 60e-6)
    assert [len(openings) for _, openings in around] == [1, 1]


SLOW: Measurement = measurements(
    recordings((sized("needle_lift_sensor_lag", tau=25e-6),), points=((100e6, 1.0e-3),))
)[0]


@given(st.floats(0.0, 70e-6))
@example(8e-6)  # a foot moves
def test_the_opened_area_follows_the_lag_smoothly(lag: float) -> None:
    """What a fit takes for a slope is one, and no size is sticky."""
    step = 1e-8
    here, ahead = (TrueInputs(SLOW, InputTerms(lift_lag=one), C).area for one in (lag, lag + step))
    change = np.abs(np.maximum(ahead, 0.0) - np.maximum(here, 0.0)).max()
    # A_S/A_0 is 5e3 a metre; the lift changes by 2 m/s, noise included; a foot that moves by a sample within the grid
    # adds or takes what the needle travels in it: a jump would be a hundred times as much
    assert change < (2.0 + 2.0 / RATE / GRID) * step * 5e3


def test_an_event_that_was_recorded_keeps_its_area() -> None:
    true = measurements(recordings(points=((100e6, 1.0e-3),)))[0]
    expected = np.maximum(TrueInputs(true, InputTerms(), C).area, 0.0).sum()
    result = np.maximum(TrueInputs(SLOW, InputTerms(lift_lag=25e-6), C).area, 0.0).sum()
    assert result == pytest.approx(expected, rel=2e-3)
