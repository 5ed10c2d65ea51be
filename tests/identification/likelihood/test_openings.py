"""Openings of the needle, and a lift recorded by a slow sensor, restored."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from observer_rt.core.stream.stream import LOOK_BACK, dead_band
from observer_rt.files.signals.recording import Recording, shown_slowly
from observer_rt.identification.likelihood.events import openings_of
from observer_rt.identification.likelihood.measurement import Measurement, measurements
from observer_rt.identification.likelihood.openings import LAG_GRID, find_openings, openings_without_lag, without_lag
from observer_rt.identification.likelihood.true_inputs import TrueInputs
from observer_rt.model.effective import TRUE_INPUTS
from observer_rt.model.effects import effective_model, sized
from tests.engine.sample_stream import NOISE as STATED
from tests.engine.sample_stream import Stream
from tests.identification.discovery.hidden import NOMINAL, recordings
from tests.observed_plants import recording_of
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Bench, Event, Needle, Shot, record

RATE, NOISE = 100e3, 0.4e-6
C = effective_model(NOMINAL).coefficients


def _lift(*strokes: tuple[int, int], samples: int = 1000) -> NDArray[np.float64]:
    """Strokes (first sample off the seat, last) with flanks of 8 um a sample, at most 300 um."""
    k = np.arange(samples, dtype=np.float64)
    lift = np.zeros(samples)
    for opening, closed in strokes:
        lift = np.maximum(lift, np.minimum(np.minimum(8e-6 * (k - opening), 8e-6 * (closed - k)), 300e-6))
    return lift


def _noisy(lift: NDArray[np.float64], seed: int = 3) -> NDArray[np.float64]:
    return lift + NOISE * np.random.default_rng(seed).normal(size=lift.size)


def test_every_stroke_is_found_with_its_flanks() -> None:
    openings = find_openings(_noisy(_lift((100, 300), (500, 540))), NOISE)
    assert len(openings) == 2
    for opening, (first, closed) in zip(openings, ((100, 300), (500, 540)), strict=True):
        assert opening.first in (first, first + 1)
        assert opening.last in (closed - 1, closed)
        for ramp, distance in ((opening.rising, opening.first - first), (opening.falling, closed - opening.last)):
            assert ramp.slope == pytest.approx(8e-6, rel=0.05)
            assert ramp.lift == pytest.approx(8e-6 * distance, abs=3 * NOISE)


def test_noise_alone_is_no_opening() -> None:
    assert find_openings(_noisy(np.zeros(200_000)), NOISE) == []


def test_openings_cut_off_by_the_ends_are_left_out() -> None:
    lift = _lift((-50, 100), (400, 600), (900, 1200))
    openings = find_openings(_noisy(lift), NOISE)
    assert [opening.first for opening in openings] in ([400], [401])


def test_missing_samples_are_shut() -> None:
    lift = _noisy(_lift((100, 300)))
    lift[600:700] = np.nan
    assert len(find_openings(lift, NOISE)) == 1


def _observed(recording: Recording) -> list[tuple[int, int]]:
    """First and last sample at which the observer has the needle open."""
    stream = Stream(sample_rate=recording.sample_rate, events_required=0)
    stream.feed(recording.rail_pressure, recording.needle_lift, recording.line_pressure).finish()
    is_open = np.concatenate(([False], stream.rows["seat_area"] > 0.0, [False]))
    edges = np.flatnonzero(np.diff(is_open))
    return list(zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True))


@pytest.mark.parametrize("rate", [100e3, 50e3])
def test_openings_are_those_that_the_observer_sees(rate: float) -> None:
    """To a sample where they begin; where they end, to what lies in the dead band: its noise may count as ramp."""
    _, shuts = dead_band(STATED.needle_lift)
    differences = []
    for seed in range(4):
        shots = [(Shot(7e-6 * k, (0.2 + 0.25 * (seed + 2 * k)) * 1e-3), Shot(4e-3, 0.3e-3)) for k in range(4)]
        events = tuple(Event((40 + 40 * seed) * 1e6, each, Faults()) for each in shots)
        recording = recording_of(record(Bench(Injector(), Needle(), events, sample_rate=rate, noise=1.0, seed=seed)))
        openings, observed = openings_of(recording), _observed(recording)
        assert len(openings) == len(observed) == 8
        for opening, (first, last) in zip(openings, observed, strict=True):
            assert abs(opening.first - first) <= 1
            assert abs(opening.last - last) <= LOOK_BACK
            beyond = recording.needle_lift[min(opening.last, last) + 1 : max(opening.last, last) + 1]
            assert (beyond <= shuts).all()
            differences.append((abs(opening.first - first), abs(opening.last - last)))
    assert np.mean(differences, axis=0) == pytest.approx([0.0, 0.15], abs=0.15)


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
    here, ahead = (TrueInputs(SLOW, TRUE_INPUTS._replace(lift_lag=one), C).area for one in (lag, lag + step))
    change = np.abs(np.maximum(ahead, 0.0) - np.maximum(here, 0.0)).max()
    # A_S/A_0 is 5e3 a metre; the lift changes by 2 m/s, noise included; a foot that moves by a sample within the grid
    # adds or takes what the needle travels in it: a jump would be a hundred times as much
    assert change < (2.0 + 2.0 / RATE / LAG_GRID) * step * 5e3


def test_an_event_that_was_recorded_keeps_its_area() -> None:
    true = measurements(recordings(points=((100e6, 1.0e-3),)))[0]
    expected = np.maximum(TrueInputs(true, TRUE_INPUTS, C).area, 0.0).sum()
    result = np.maximum(TrueInputs(SLOW, TRUE_INPUTS._replace(lift_lag=25e-6), C).area, 0.0).sum()
    assert result == pytest.approx(expected, rel=2e-3)
