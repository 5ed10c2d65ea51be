"""Stated delays of rail pressure and lift are undone before the observer sees a sample."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.core.stream.stream import Break, dead_band
from observer_rt.model.effects import sized
from tests.engine.sample_stream import NOISE, RAIL, Stream

RATE = 100e3
LAG = 15.9e-6
SLOW = (sized("needle_lift_sensor_lag", tau=LAG),)


@pytest.mark.parametrize("delay", [-42.0, -16.0, 3.0, 20.0, 57.0])
def test_a_late_rail_pressure_is_brought_to_its_time(delay: float) -> None:
    """Delays [us], negative where the lift is later; at both ends it keeps its value."""
    index = np.arange(400)
    true = np.linspace(1e8, 1e8 + 399e4, 400)
    stream = Stream(stated=(sized("rail_pressure_skew", d=1e-6 * delay),))
    stream.feed(true - 1e4 * delay / 10.0, np.zeros(400), true).finish()
    rows, c = stream.rows, stream.observer.constants.coefficients
    result = rows["rail_pressure"] * c.pressure_scale + c.chamber_pressure
    assert np.array_equal(rows["index"], index)
    assert result[6:-6] == pytest.approx(true[6:-6], rel=1e-12)
    assert np.abs(np.diff(result)).max() <= 1.001e4
    assert rows["line_pressure"] * c.pressure_scale + c.chamber_pressure == pytest.approx(true)


@settings(max_examples=10, deadline=None)
@given(st.lists(st.integers(1, 40), min_size=1, max_size=30), st.integers(5, 290))
def test_how_many_samples_come_together_changes_nothing(pieces: list[int], restart: int) -> None:
    rng = np.random.default_rng(1)
    signals = RAIL + rng.normal(0.0, 1e5, 300), 1e-5 * rng.random(300), RAIL + rng.normal(0.0, 1e5, 300)
    stated = (*SLOW, sized("rail_pressure_skew", d=27e-6))

    def rows(bounds: list[int]) -> NDArray[np.void]:
        stream = Stream(stated=stated)
        for start, end in itertools.pairwise(bounds):
            broken = Break.RESTART if start == restart else Break.NONE
            rail, lift, line = (signal[start:end] for signal in signals)
            stream.feed(rail, lift, line, index=start, broken=broken)
        return stream.finish().rows

    together = rows([0, restart, 300])
    apart = rows(sorted({0, restart, 300} | ({int(end) for end in np.cumsum(pieces) if end < 300})))
    for name in ("rail_pressure", "needle_lift", "line_pressure", "lift", "rail_share", "injection_rate", "doubt"):
        np.testing.assert_array_equal(together[name], apart[name])
    assert np.array_equal(together["index"], np.arange(300))
    assert np.flatnonzero(together["broken"]).tolist() == [0, restart]


def test_nothing_is_taken_from_beyond_a_break() -> None:
    lift = np.concatenate((np.zeros(50), np.full(50, 200e-6)))
    rail = np.concatenate((np.full(50, 100e6), np.full(50, 80e6)))
    stream = Stream(stated=(*SLOW, sized("rail_pressure_skew", d=27e-6)))
    stream.feed(rail[:50], lift[:50], rail[:50])
    stream.feed(rail[50:], lift[50:], rail[50:], index=5000, broken=Break.LOSS).finish()
    rows, c = stream.rows, stream.observer.constants.coefficients
    result = rows["rail_pressure"] * c.pressure_scale + c.chamber_pressure
    assert result == pytest.approx(rail)
    assert rows["needle_lift"] == pytest.approx(lift)


def test_the_dead_band_is_that_of_the_louder_lift() -> None:
    stream = Stream(stated=SLOW)
    stated = stream.observer.memory[0]["dead_band"]["lift_on"]
    assert stated == pytest.approx(dead_band(NOISE.needle_lift * np.hypot(1.0, 1e5 * LAG / np.sqrt(2.0)))[0])
    rng = np.random.default_rng(2)
    stream.feed(np.full(8000, RAIL), rng.normal(0.0, NOISE.needle_lift, 8000), np.full(8000, RAIL))
    assert stream.observer.memory[0]["dead_band"]["lift_on"] == pytest.approx(stated, rel=0.06)
    assert stream.count("event", "number") == 0
