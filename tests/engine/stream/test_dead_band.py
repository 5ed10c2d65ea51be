"""When the needle counts as open: dead band, hysteresis, look-back to the foot of the ramp."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.core.model.laws import seat_area
from observer_rt.core.stream.stream import LOOK_BACK, dead_band
from tests.engine.sample_stream import NOMINAL, Stream, stroke

UM = 1e-6


def open_samples(lift: NDArray[np.float64]) -> list[int]:
    stream = Stream().stay_shut(5e-3).move(lift).stay_shut(1e-3)
    return [int(row["index"]) - 500 for row in stream.rows if row["seat_area"] > 0.0]


@pytest.mark.parametrize(("noise", "opens"), [(0.4e-6, 2e-6), (0.1e-6, 2e-6), (1e-6, 5e-6)])
def test_dead_band_is_five_sigma_and_at_least_two_micrometres(noise: float, opens: float) -> None:
    on, off = dead_band(noise)
    assert on == pytest.approx(opens)
    assert 0.0 < off < on


def test_noise_never_opens_the_needle() -> None:
    """Ten seconds of 0.4 um at 100 kHz: no sample of a million has a seat area, no event begins."""
    random = np.random.default_rng(1)
    stream = Stream(keep=False)
    for _ in range(100):
        stream.move(random.normal(0.0, 0.4 * UM, 10_000))
    assert stream.count("positions", "processed") > 999_000
    assert stream.count("event", "number") == 0
    assert stream.count("standstill", "rest_count") > 999_000 - 1000


def test_samples_above_the_band_open_and_the_look_back_has_its_raw_lift() -> None:
    """Three samples before the crossing count with what they measured, those before them do not."""
    lift = np.array([0.3, 0.6, 0.9, 1.2, 1.5, 2.5, 6.0, 14.0, 22.0, 30.0, *[30.0] * 50, 15.0, 1.5]) * UM
    stream = Stream().stay_shut(5e-3).move(lift).stay_shut(1e-3)
    area = {int(row["index"]) - 500: float(row["seat_area"]) for row in stream.rows}
    crossing = 5
    assert area[crossing - LOOK_BACK - 1] == 0.0
    half_cone = math.radians(NOMINAL.seat.cone_angle / 2)
    for k in range(crossing - LOOK_BACK, crossing + 5):
        expected = seat_area(lift[k], NOMINAL.seat.diameter, half_cone) / NOMINAL.scaling.area
        assert area[k] == pytest.approx(expected, rel=1e-2 if k < crossing else 1e-3)  # the zero is followed


def test_foot_of_the_ramp_does_not_close_the_needle_again() -> None:
    """Look-back samples lie below the closing threshold: still one injection."""
    lift = np.concatenate([[0.7 * UM, 0.8 * UM, 0.9 * UM], stroke(60)])
    stream = Stream().stay_shut(5e-3).move(lift).stay_shut(1e-3)
    assert (stream.count("counts", "injections_begun"), open_samples(lift)) == (1, list(range(63)))


@pytest.mark.parametrize(
    ("foot", "first"),
    [
        ([0.7, 0.8, 0.9], 0),
        ([0.7, 0.5, 0.9], 2),  # what lies in the noise parts the foot from what was before
        ([0.1, 0.2, 0.4], 3),
        ([3.0, 0.9, 0.9], 1),  # a spike before it is none of it
    ],
)
def test_look_back_is_only_as_long_as_the_lift_stands_out_of_the_noise(foot: list[float], first: int) -> None:
    assert open_samples(np.concatenate([np.array(foot) * UM, stroke(60)]))[0] == first


@pytest.mark.parametrize("phase", [0.2, 0.5, 0.9])
def test_seat_opens_and_shuts_between_samples_where_the_needle_does(phase: float) -> None:
    """20 kHz, 0.4 m/s: 20 um a sample. The ramps start and end `phase` of a sample after one."""
    time = np.arange(80) - 20 - phase
    lift = 20 * UM * np.clip(np.minimum(time, 40 - time), 0.0, 15.0)
    area = Stream(sample_rate=20e3).stay_shut(5e-3).move(lift).stay_shut(1e-3).rows["seat_area"][100:180]
    opened = np.flatnonzero(area > 0.0)
    before, after = opened[0] - 1, opened[-1] + 1
    assert (before, after) == (20, 61)
    zero = [before - area[before] / (area[before + 1] - area[before]), after]
    zero[1] = after - area[after] / (area[after] - area[after - 1])
    assert zero == pytest.approx([20 + phase, 60 + phase], abs=0.06)
    assert not area[[before - 1, after + 1]].any()


def test_hysteresis() -> None:
    """Between the thresholds an open needle stays open, unless it lingers, and a shut one shut."""
    assert open_samples(np.full(50, 1.5 * UM)) == []
    opened = np.concatenate([stroke(60)[:30], np.full(8, 1.5 * UM), stroke(60)[30:]])
    assert open_samples(opened) == list(range(68))


@pytest.mark.parametrize(("samples", "rate", "opens"), [(3, 100e3, 0), (4, 100e3, 1), (7, 200e3, 0), (1, 20e3, 0)])
def test_what_lasts_less_than_forty_microseconds_is_no_opening(samples: int, rate: float, opens: int) -> None:
    spike = np.zeros(50)
    spike[20 : 20 + samples] = 50 * UM
    stream = Stream(sample_rate=rate).stay_shut(5e-3).move(spike).stay_shut(1e-3)
    assert stream.count("counts", "injections_begun") == opens


LOW: NDArray[np.float64] = np.maximum(18.0 - 3.0 * np.abs(np.arange(26) - 13.0), 0.0) * UM
"""A needle that turns low above its seat: no straight line bridges a sample there, and none of them is a leap."""
TURNS = 13  # samples from its beginning


def test_one_sample_is_not_enough_to_close_and_has_no_area_without_a_lift() -> None:
    without = open_samples(LOW)
    assert TURNS in without
    for lift in (0.0, -1 * UM):
        low = LOW.copy()
        low[TURNS] = lift
        assert open_samples(low) == [k for k in without if k != TURNS]


@pytest.mark.parametrize("slope", [5.0, 0.0], ids=["turning", "steady"])
def test_a_leap_of_one_sample_is_bridged(slope: float) -> None:
    """No needle leaves 2 m/s and comes back in one sample: its injection would be parted in two."""
    lift = np.asarray((200.0 - slope * np.abs(np.arange(50) - 20.0)) * UM, np.float64)
    lift[20] = 0.0
    assert open_samples(lift) == list(range(50))


def test_shut_from_the_first_of_two_samples_below_the_closing_threshold() -> None:
    lift = np.concatenate([np.full(30, 100 * UM), [3 * UM, 0.9 * UM, 0.8 * UM, 0.9 * UM, 0.5 * UM]])
    assert open_samples(lift) == list(range(31))
