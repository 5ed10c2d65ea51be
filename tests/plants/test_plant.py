"""The plant: independent of the package, right by a reference solution."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.plants import plant
from tests.plants.arrays import Array
from tests.plants.equations import lift_at
from tests.plants.parameters import Faults, Injector

pytestmark = pytest.mark.slow


def once(
    injector: Injector = Injector(),  # noqa: B008 - immutable
    rail_pressure: float = 100e6,
    duration: float = 1.9e-3,
    noise: float = 0.0,
) -> plant.Outcome:
    event = plant.Event(rail_pressure, (plant.Shot(0.0, duration),), Faults())
    return plant.record(plant.Bench(injector, plant.Needle(), (event,), noise=noise, seed=1))


def reference(event: plant.Event, until: float) -> tuple[Array, Array, Array]:
    """Equations (19)-(23) of the nominal part as the paper prints them, by an adaptive implicit solver."""
    part = Injector()
    strokes = plant.strokes_of(event, plant.FIRST_EVENT, plant.Needle(), part.max_lift)
    jet = math.sqrt(2.0 / part.density)

    def root(d: float) -> float:
        return math.copysign(math.sqrt(abs(d)), d)

    def rates(t: float, x: Array) -> list[float]:
        p_l, q_l, p_s = x
        lift = lift_at(t, strokes)
        sine, sine_full = math.sin(part.seat_half_angle), math.sin(2 * part.seat_half_angle)
        area = math.pi * lift * sine * (part.seat_diameter - 0.5 * lift * sine_full)
        q_s = part.seat_coefficient * area * jet * root(p_l - p_s)
        q_h = part.nozzle_area * jet * root(p_s - part.chamber_pressure)
        return [
            part.bulk_modulus_line / part.line_volume * (q_l - q_h),
            part.line_area / (part.density * part.line_length) * (event.rail_pressure - p_l)
            - part.line_loss / (2.0 * part.line_area * part.line_length) * q_l * abs(q_l),
            part.bulk_modulus_sac / part.sac_volume * (q_s - q_h),
        ]

    times = np.arange(round(plant.FIRST_EVENT * 1e5) - 5, round(until * 1e5)) / 1e5
    start = [event.rail_pressure, 0.0, part.chamber_pressure]
    solved = solve_ivp(
        rates, (times[0], times[-1]), start, "LSODA", times, rtol=1e-8, atol=[1.0, 1e-12, 1.0], max_step=1e-6
    )
    rate = part.nozzle_area * jet * np.sqrt(np.maximum(solved.y[2] - part.chamber_pressure, 0.0))
    return times, solved.y[0], rate


@pytest.mark.parametrize("rail_pressure", [40e6, 150e6])
def test_agrees_with_an_adaptive_solver(rail_pressure: float) -> None:
    event = plant.Event(rail_pressure, (plant.Shot(0.0, 0.8e-3),), Faults())
    times, line, rate = reference(event, plant.FIRST_EVENT + 2e-3)
    truth = once(rail_pressure=rail_pressure, duration=0.8e-3).truth
    samples = slice(round(times[0] * 1e5), round(times[0] * 1e5) + times.size)
    assert np.max(np.abs(truth.line_pressure[samples] - line)) < 2e3
    assert np.max(np.abs(truth.injection_rate[samples] - rate)) < 0.1e-6  # as the sac runs empty; elsewhere far less
    assert np.sum(truth.injection_rate[samples]) == pytest.approx(np.sum(rate), rel=2e-4)


def ringing_frequency(outcome: plant.Outcome) -> float:
    """Of the line pressure 2-12 ms after the needle shut, by its crossings of the rail pressure."""
    shut = int(outcome.openings[-1, 1])
    part = slice(shut + 200, shut + 1200)
    swing = (outcome.truth.line_pressure - outcome.truth.rail_pressure)[part]
    up = np.flatnonzero((swing[:-1] < 0.0) & (swing[1:] >= 0.0))
    exact = up - swing[up] / (swing[up + 1] - swing[up])
    return float((exact.size - 1) / (exact[-1] - exact[0]) * 1e5)


def test_lump_rings_at_its_mode_and_a_wave_line_at_its_quarter_wave() -> None:
    part = Injector()
    inertance = part.density * part.line_length / part.line_area
    travel_time = math.sqrt(inertance * part.line_volume / part.bulk_modulus_line)
    assert ringing_frequency(once()) == pytest.approx(1.0 / (2.0 * math.pi * travel_time), rel=0.01)
    assert ringing_frequency(once(injector=plant.wave_injector())) == pytest.approx(
        1.0 / (4.0 * travel_time), rel=0.02
    )


def test_noise_and_codes_are_those_of_sensors_and_bus() -> None:
    measured: plant.Signals = once(noise=1.0).measured
    standstill = slice(0, 14_000)
    for signal, sigma, step in (
        (measured.rail_pressure, 0.1e6, 0.005e6),
        (measured.line_pressure, 0.15e6, 0.005e6),
        (measured.needle_lift, 0.4e-6, 0.01e-6),
    ):
        assert np.std(signal[standstill]) == pytest.approx(sigma, rel=0.03)
        codes = signal / step
        np.testing.assert_allclose(codes, np.rint(codes), atol=1e-6)
