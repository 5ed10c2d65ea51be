"""Where a stretch of published rates lies in what the model makes of samples that are counted here."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.desk.live_page.samples import CountShift, best_place

LENGTH, WINDOW = 1200, 300


def injections(first: int, second: int) -> NDArray[np.float64]:
    """A short and a long one [mm3/ms]."""
    time = np.arange(LENGTH)
    short, long = (
        np.clip((width - abs(time - at)) / 20.0, 0.0, 1.0) for at, width in ((first, 30), (second, 70))
    )
    return np.asarray(40.0 * short + 50.0 * long)


@given(
    place=st.integers(0, LENGTH - WINDOW),
    wear=st.floats(-0.25, 0.3),
    seed=st.integers(0, 1000),
    missing=st.integers(0, 60),
)
def test_the_place_is_found_whatever_the_wear(place: int, wear: float, seed: int, missing: int) -> None:
    modelled = injections(place + 90, place + 210)
    random = np.random.default_rng(seed)
    published = (1.0 + wear) * modelled[place : place + WINDOW] + random.normal(0.0, 0.5, WINDOW)
    published[130 : 130 + missing] = np.nan
    assert best_place(published, modelled) == place


def test_other_rates_have_no_place() -> None:
    modelled = injections(300, 600)
    assert best_place(np.zeros(WINDOW), modelled) is None
    assert best_place(np.full(WINDOW, np.nan), modelled) is None
    assert best_place(np.full(WINDOW, 50.0), modelled) is None


def test_a_rate_comes_after_its_samples() -> None:
    shift = CountShift(lookahead=10, rate_hz=1000.0)
    assert not shift.candidates
    shift.note(published=500, received=120)  # late by 20
    shift.note(published=528, received=135)  # by 7: the promptest
    shift.note(published=556, received=170)
    assert 400 in shift.candidates
    assert len(shift.candidates) <= 16


def test_the_observers_count_may_come_round() -> None:
    shift = CountShift(lookahead=10, rate_hz=1000.0)
    shift.note(published=(1 << 32) - 3, received=90)
    assert -90 in shift.candidates
