"""Every effect of the vocabulary in the simulated plant, against its law integrated by scipy in physical units."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from observer_rt.config.bench import load_injector
from observer_rt.core.model.needle import lift_of_stroke
from observer_rt.desk.simulation.schedule import make_schedule, strokes
from observer_rt.desk.simulation.simulate import Simulation, simulate
from observer_rt.foundation.units import Floats
from observer_rt.model.effects import VOCABULARY, sized

NOMINAL = load_injector()
OPEN_FOR = 1.1e-3  # s, energizing
SIZES: Mapping[str, Mapping[str, float]] = {
    "orifice_area": {"v_H": -0.3},
    "seat_area": {"v_S": 0.4},
    "guide_leakage": {"c": 3e-14},
    "control_flow": {"c": 4e-6, "d_on": 40e-6, "d_off": -30e-6},
    "line_friction": {"k": 3.0},
    "seat_outflow": {},
    "bulk_modulus": {"r": 0.3},
    "line_volume": {"r": 0.3},
    "pressure_dependent_bulk_modulus": {"n": 8.0},
    "entrained_air": {"g": 5e-3},
    "fuel_density": {"r": 0.1},
    "orifice_cavitation": {"n_crit_excess": 0.12},
    "lift_dependent_seat_coefficient": {"a": 0.5, "x_c": 80e-6},
    "chamber_pressure_rise": {"dp": 10e6, "s": 0.4},
}
SENSORS: Mapping[str, Mapping[str, float]] = {
    "lift_offset": {"x_0": 20e-6},
    "lift_gain": {"g": 0.1},
    "needle_lift_sensor_lag": {"tau": 30e-6},
    "rail_pressure_skew": {"d": 25e-6},
    "rail_pressure_sensor_gain": {"g": 0.02},
    "rail_pressure_sensor_offset": {"o": -3e6},
    "line_pressure_sensor_lag": {"tau": 40e-6},
    "line_pressure_sensor_offset": {"o": 0.8e6},
    "channel_skew": {"d": 13e-6},
}
NEEDLE = {  # sizes, and by how much later the half lift is passed, up and down; 187 and 167 us of ramp at 100 MPa
    "opening_delay": ({"d": 50e-6}, 50e-6, 0.0),
    "opening_speed": ({"r": 0.5}, -62.5e-6, 0.0),
    "closing_delay": ({"d": -50e-6}, 0.0, -50e-6),
    "closing_speed": ({"r": 0.5}, 0.0, -55.6e-6),
    "needle_bounce": ({"b": 20e-6}, 0.0, 0.0),
}


@dataclass(frozen=True)
class Effects:
    """Sizes by effect and parameter, SI; 0 where an effect is off."""

    sizes: Mapping[str, Mapping[str, float]]

    def __call__(self, effect: str, parameter: str) -> float:
        return self.sizes.get(effect, {}).get(parameter, 0.0)


def rates_of(rail: float, of: Effects):  # type: ignore[no-untyped-def]
    """Right-hand side of (19)-(23) with the laws of the vocabulary, and the nozzle flow [m3/s]."""
    (needle,) = strokes(make_schedule([rail], 1, 0.05, [OPEN_FOR]), NOMINAL)
    fluid, line, seat, nozzle = NOMINAL.fluid, NOMINAL.line, NOMINAL.seat, NOMINAL.nozzle
    line_area = math.pi / 4 * line.diameter**2
    hole_area = nozzle.holes * math.pi / 4 * nozzle.hole_diameter**2
    cone = math.radians(seat.cone_angle)
    density = fluid.density_line * (1 + of("fuel_density", "r"))
    volume = line.volume * (1 + of("line_volume", "r"))
    scale = of("lift_dependent_seat_coefficient", "x_c") or 1.0

    def orifice(coefficient: float, area: float, drop: float) -> float:
        return coefficient * area * drop / math.sqrt(math.hypot(drop, 0.5e6)) * math.sqrt(2 / density)

    def seat_area(lift: float) -> float:
        return math.pi * lift * math.sin(cone / 2) * (seat.diameter - lift / 2 * math.sin(cone))

    def chamber(time: float) -> float:
        lift = lift_of_stroke(time, needle)
        if lift <= 0.0:
            return NOMINAL.chamber.pressure
        opened = seat_area(lift) / seat_area(seat.max_lift)
        share = 1 - of("chamber_pressure_rise", "s") * (1 - opened)
        return NOMINAL.chamber.pressure + of("chamber_pressure_rise", "dp") * share

    times = np.arange(0.1499, 0.155, 1e-7)
    lifts = np.array([lift_of_stroke(time, needle) for time in times.tolist()])
    opens = times[lifts > 15e-6][0] - 0.25e-3 - of("control_flow", "d_on")
    shuts = times[lifts > lifts.max() - 15e-6][-1] - 0.2e-3 - of("control_flow", "d_off")

    def pilot_valve(time: float) -> float:
        return 0.25 * (1 + math.tanh((time - opens) / 20e-6)) * (1 + math.tanh((shuts - time) / 20e-6))

    def nozzle_flow(time: float, p_sac: float) -> float:
        coefficient = nozzle.flow_coefficient * (1 + of("orifice_area", "v_H"))
        drop = p_sac - chamber(time)
        critical = 1 + of("orifice_cavitation", "n_crit_excess")
        if drop > 0.0 and (p_sac - fluid.vapour_pressure) / drop < critical:
            coefficient *= math.sqrt((p_sac - fluid.vapour_pressure) / drop / critical)
        return orifice(coefficient, hole_area, drop)

    def rates(time: float, state: Floats) -> list[float]:
        p_line, q_line, p_sac = state
        lift = lift_of_stroke(time, needle)
        area = seat_area(lift)
        loss = of("lift_dependent_seat_coefficient", "a") * math.exp(-lift / scale)
        coefficient = seat.flow_coefficient * (1 + of("seat_area", "v_S")) * (1 - loss)
        q_seat = orifice(coefficient, area, p_line - p_sac)
        q_nozzle = nozzle_flow(time, p_sac)
        leak = of("guide_leakage", "c") * (p_line - NOMINAL.chamber.pressure)
        leak += of("control_flow", "c") * pilot_valve(time) * math.sqrt(p_line / 100e6)
        drain = q_seat if "seat_outflow" in of.sizes else q_nozzle
        stiffness = fluid.bulk_modulus_line * (1 + of("bulk_modulus", "r"))
        stiffness += of("pressure_dependent_bulk_modulus", "n") * (p_line - 100e6)
        stiffness = 1 / (1 / stiffness + of("entrained_air", "g") / p_line)
        friction = line.loss_factor * (1 + of("line_friction", "k")) / (2 * line_area * line.length)
        return [
            stiffness / volume * (q_line - drain - leak),
            line_area / (density * line.length) * (rail - p_line) - friction * q_line * abs(q_line),
            fluid.bulk_modulus_sac / nozzle.sac_volume * (q_seat - q_nozzle),
        ]

    return rates, nozzle_flow


def reference(rail: float, of: Effects, times: Floats) -> tuple[Floats, Floats]:
    """Injection rate [m3/s] and line pressure [Pa] at `times`, from a line without flow, long before."""
    stepped, leaks = "chamber_pressure_rise" in of.sizes, "guide_leakage" in of.sizes
    rates, nozzle_flow = rates_of(rail, of)
    start, span = [rail, 0.0, NOMINAL.chamber.pressure], [0.0 if leaks else times[0], times[-1]]
    exact = {"rtol": 1e-8, "atol": [1.0, 1e-12, 1.0], "max_step": 1e-7 if stepped else 1e-5}
    solution = solve_ivp(rates, span, start, "LSODA", times, **exact)
    rate = [nozzle_flow(t, p) for t, p in zip(times, solution.y[2], strict=True)]
    return np.array(rate), solution.y[0]


@cache
def simulated(name: str, rail: float) -> Simulation:
    """One injection 0.15 s in, without noise."""
    sizes = {**SIZES, **SENSORS, **{one: size for one, (size, *_) in NEEDLE.items()}}.get(name)
    effects = () if sizes is None else (sized(name, **sizes),)
    return simulate(NOMINAL, make_schedule([rail], 1, 0.05, [OPEN_FOR]), 100e3, effects)


def test_all_effects_are_tested() -> None:
    assert SIZES.keys() | SENSORS.keys() | NEEDLE.keys() == VOCABULARY.keys()


@pytest.mark.parametrize("name", NEEDLE)
def test_the_needle_passes_half_its_lift_later(name: str) -> None:
    _, *later = NEEDLE[name]
    usual, moved = (np.flatnonzero(np.diff(simulated(one, 100e6).truth.needle_lift > 0.15e-3)) for one in ("", name))
    assert (moved - usual) * 1e-5 == pytest.approx(later, abs=1e-5)


def test_a_needle_bounces_by_half_a_sine_from_its_landing_on() -> None:
    truth, usual = (simulated(name, 100e6).truth for name in ("needle_bounce", ""))
    landed = 0.15 + OPEN_FOR + NOMINAL.needle.closing_delay + NOMINAL.seat.max_lift / NOMINAL.needle.closing_speed
    means = landed + np.linspace(-15e-6, 15e-6, 3001)  # over which corners are rounded
    near, bounce = np.abs(truth.time - landed) < 1e-3, np.zeros(truth.time.size)
    at = np.clip((truth.time[near, None] - means) / NOMINAL.needle.bounce_length, 0.0, 1.0)
    bounce[near] = 20e-6 * np.sin(math.pi * at).mean(axis=1)
    np.testing.assert_allclose(truth.needle_lift - usual.needle_lift, bounce, atol=5e-9)


@pytest.mark.parametrize(("name", "rail"), [*((name, 140e6) for name in SIZES), ("orifice_cavitation", 60e6)])
def test_plant_follows_the_law(name: str, rail: float) -> None:
    truth = simulated(name, rail).truth
    window = (truth.time > 0.1499) & (truth.time < 0.155)
    rate, pressure = reference(rail, Effects({name: SIZES[name]}), truth.time[window])
    healthy = simulated("", rail).truth
    if name == "chamber_pressure_rise":  # a step, which the plant's own steps of 1 us place to a part of one
        volume = float(np.trapezoid(truth.injection_rate[window] - rate)) * 1e-5
        assert abs(volume) < 0.02e-9
        np.testing.assert_allclose(truth.line_pressure[window], pressure, atol=10e3)
    else:
        np.testing.assert_allclose(truth.line_pressure[window], pressure, atol=5e3)
        np.testing.assert_allclose(truth.injection_rate[window], rate, atol=0.01e-6)
    changed = np.abs(truth.line_pressure - healthy.line_pressure).max()
    works = not (name == "orifice_cavitation" and rail < 100e6)
    assert (changed > 0.2e6) == works


def test_sensors_do_not_change_the_plant() -> None:
    for name in SENSORS:
        simulation, healthy = simulated(name, 100e6), simulated("", 100e6)
        np.testing.assert_array_equal(simulation.truth.injection_rate, healthy.truth.injection_rate)
        np.testing.assert_array_equal(simulation.truth.line_pressure, healthy.truth.line_pressure)


@pytest.mark.parametrize(
    ("name", "signal", "law"),
    [
        ("lift_offset", "needle_lift", lambda true: np.maximum(true - 20e-6, 0.0)),
        ("lift_gain", "needle_lift", lambda true: true / 1.1),
        ("rail_pressure_sensor_gain", "rail_pressure", lambda true: 1.02 * true),
        ("rail_pressure_sensor_offset", "rail_pressure", lambda true: true - 3e6),
        ("line_pressure_sensor_offset", "line_pressure", lambda true: true + 0.8e6),
    ],
)
def test_what_a_sensor_says_of_the_truth(name: str, signal: str, law: Callable[[Floats], Floats]) -> None:
    result = getattr(simulated(name, 100e6).recording, signal)
    expected = law(getattr(simulated("", 100e6).truth, signal))
    np.testing.assert_allclose(result, expected, rtol=1e-12, atol=1e-12)


def test_lift_recorded_too_high_is_zero_while_shut() -> None:
    schedule = make_schedule([100e6], 1, 0.05, [OPEN_FOR])
    result = simulate(NOMINAL, schedule, 100e3, (sized("lift_offset", x_0=-20e-6),))
    true = result.truth.needle_lift
    np.testing.assert_allclose(result.recording.needle_lift, np.where(true > 0.0, true + 20e-6, 0.0), atol=1e-12)


@pytest.mark.parametrize(
    ("name", "signal", "tau", "exact"),
    [
        ("needle_lift_sensor_lag", "needle_lift", 30e-6, 0.3e-6),
        ("line_pressure_sensor_lag", "line_pressure", 40e-6, 5e3),
    ],
)
def test_slow_sensors(name: str, signal: str, tau: float, exact: float) -> None:
    """Their answer to an impulse, in steps of 1 us, folded with what a fine simulation has."""
    slow = simulated(name, 100e6).recording
    fine = simulate(NOMINAL, make_schedule([100e6], 1, 0.05, [OPEN_FOR]), 1e6).truth
    true, answer = getattr(fine, signal), np.exp(-np.arange(500) * 1e-6 / tau)
    expected = true[0] + np.convolve(true - true[0], answer / answer.sum())[: true.size]
    shown = getattr(slow, signal)
    np.testing.assert_allclose(shown, np.interp(slow.time, fine.time + 0.5e-6, expected), atol=exact)
    assert np.abs(shown - getattr(simulated("", 100e6).recording, signal)).max() > 50.0 * exact


def test_rail_pressure_recorded_late() -> None:
    schedule = make_schedule([60e6, 140e6], 2, 0.05, [OPEN_FOR])  # between them the rail is filled
    late = simulate(NOMINAL, schedule, 100e3, (sized("rail_pressure_skew", d=25e-6),)).recording
    expected = schedule.rail_pressure(late.time - 25e-6)
    np.testing.assert_allclose(late.rail_pressure, expected, atol=2e3)
    assert np.abs(late.rail_pressure - schedule.rail_pressure(late.time)).max() > 50e3


@pytest.mark.parametrize("delay", [-23e-6, -4e-6, 4e-6, 10e-6, 57e-6])
def test_line_pressure_recorded_late(delay: float) -> None:
    """The pressure a fine simulation has at t - d."""
    schedule = make_schedule([100e6], 1, 0.05, [OPEN_FOR])
    late = simulate(NOMINAL, schedule, 100e3, (sized("channel_skew", d=delay),)).recording
    fine = simulate(NOMINAL, schedule, 1e6).truth
    expected = np.interp(late.time - delay, fine.time, fine.line_pressure)
    np.testing.assert_allclose(late.line_pressure, expected, atol=2e3)
    on_time = simulated("", 100e6).recording.line_pressure
    assert np.abs(late.line_pressure - on_time).max() > 0.3e6
