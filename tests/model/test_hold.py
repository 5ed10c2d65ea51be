"""What it costs to hold inputs constant between samples, and how little to take them as linear."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.core.model.laws import normalised_area
from observer_rt.core.model.model import fault_with_rate
from observer_rt.desk.simulation.plant import Truth, run_plant
from observer_rt.desk.simulation.schedule import Stroke
from observer_rt.model.effective import coefficients
from observer_rt.model.effects import effective_model
from observer_rt.model.network import zero_network
from observer_rt.model.stability import substeps_needed
from tests.intervals import Interval
from tests.model.conftest import Trajectory, advanced, advanced_over

NOMINAL = load_injector()
C = coefficients(NOMINAL)
RAIL_PRESSURE = 100e6
FINE = 1e-6  # s
PHASES = 10


@pytest.fixture(scope="module")
def truth() -> Truth:
    """The check needle: open for 1.9 ms from 1 ms on, up and down in 0.25 ms each."""
    speed = NOMINAL.seat.max_lift / 0.25e-3
    needle = Stroke(1.0e-3, 1.25e-3, 2.65e-3, 2.9e-3, speed, speed)
    time = np.linspace(0.0, 3599 * FINE, 3600)
    rail_pressure = np.full(time.shape, RAIL_PRESSURE)
    return run_plant(effective_model(NOMINAL), [needle], time, rail_pressure)


@pytest.mark.parametrize(
    ("sample_rate", "constant", "linear"), [(100e3, 0.85, 0.04), (20e3, 4.9, 0.7), (10e3, 10.0, 2.3)]
)
def test_error_of_the_hold(
    truth: Truth, integrate: Trajectory, sample_rate: float, constant: float, linear: float
) -> None:
    """Root mean square over the injection's window and the phases of the grid, in mm3/ms."""
    errors = {hold: _error(truth, integrate, sample_rate, hold) for hold in (True, False)}
    assert errors[True] == pytest.approx(constant, rel=0.3)
    assert errors[False] == pytest.approx(linear, rel=0.3)
    assert errors[True] / errors[False] >= 4.0


def _error(truth: Truth, integrate: Trajectory, sample_rate: float, zero_order_hold: bool) -> float:
    every = round(1 / (FINE * sample_rate))
    rail = (RAIL_PRESSURE - C.chamber_pressure) / C.pressure_scale
    errors = []
    for phase in range(0, every, every // PHASES):
        at = np.arange(phase, truth.time.size, every)
        inputs = np.array([(rail, _area(lift)) for lift in truth.needle_lift[at]])
        states = integrate(
            inputs,
            (rail, 0.0, 0.0),
            1 / sample_rate,
            substeps_needed(NOMINAL, sample_rate),
            C,
            zero_order_hold=zero_order_hold,
        )
        rate = np.array(
            [
                fault_with_rate(tuple(x), tuple(u), C, zero_network())[1]
                for x, u in zip(states, inputs, strict=True)
            ]
        )
        window = (truth.time[at] >= 0.85e-3) & (truth.time[at] <= 3.4e-3)
        errors.append(_rms((rate - truth.injection_rate[at])[window]))
    return float(np.mean(errors)) * 1e6


def _area(lift: float) -> float:
    return float(normalised_area(lift, C.seat))


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


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
                fine, Interval((0.95, before), (0.95, after), interval / 4000, 1), C, zero_network()
            )
        interval_of_sample = Interval(u_start, u_end, interval, substeps)
        bent = advanced_over(x, interval_of_sample, (share, knot), C, zero_network())
        straight = advanced(x, interval_of_sample, C, zero_network())
        assert bent == pytest.approx(fine, abs=1e-4)
        assert np.abs(np.subtract(straight, fine)).max() > 4e-3


def test_no_bend_changes_nothing() -> None:
    ends = (0.95, 0.2), (0.94, 0.5)
    interval_of_sample = Interval(*ends, 5e-5, 21)
    plain = advanced((0.8, 0.6, 0.5), interval_of_sample, C, zero_network())
    assert advanced_over((0.8, 0.6, 0.5), interval_of_sample, (0.0, 0.7), C, zero_network()) == plain
    on_the_line = advanced_over((0.8, 0.6, 0.5), interval_of_sample, (0.5, 0.35), C, zero_network())
    assert on_the_line == pytest.approx(plain, abs=1e-4)
