"""The compiled RK4: its order, what it conserves, and its agreement with an independent integration."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from observer_rt.config.bench import load_injector
from observer_rt.core.model.model import advance_state, phi_and_rate
from observer_rt.model.effective import Coefficients, coefficients
from observer_rt.model.network import constant_network
from observer_rt.model.parameters import InjectorParameters, LineOutflow
from observer_rt.model.stability import substeps_needed
from tests.intervals import Interval
from tests.model.conftest import State, filled, integrate, physical_rates
from tests.plants.arrays import Array

NO_FAULT = constant_network()
SAMPLE = 1e-5  # s
RAIL = 0.95


def stroke(length: int, sample: float, area: float = 0.95) -> Array:
    """Inputs (length, 2) over 4 ms: rail at RAIL, needle up from 0.5 to 0.75 ms, down from 2 to 2.25 ms."""
    opening = np.interp(np.arange(length) * sample, [0.5e-3, 0.75e-3, 2.0e-3, 2.25e-3], [0.0, area, area, 0.0])
    return np.column_stack([np.full(length, RAIL), opening])


def _end_state(c: Coefficients, steps: int) -> Array:
    span, first, last = 5e-5, np.array([0.95, 0.6]), np.array([1.0, 0.8])
    x, network = np.array([0.9, 1.0, 0.7]), constant_network(0.3, -0.2)
    for k in range(steps):
        start, end = (first + (last - first) * at / steps for at in (k, k + 1))
        advance_state(x, Interval((start[0], start[1]), (end[0], end[1]), span / steps, 1), c, network)
    return x


@pytest.mark.parametrize("component", range(3))
def test_order_of_convergence_is_four(injector: InjectorParameters, component: int) -> None:
    c = coefficients(injector)
    reference = _end_state(c, 4096)
    errors = [abs(_end_state(c, steps) - reference)[component] for steps in (32, 64, 128)]
    orders = [math.log2(coarse / fine) for coarse, fine in pairwise(errors)]
    assert orders == pytest.approx([4.0, 4.0], abs=0.25)


def test_conserving_form_conserves_mass(injector: InjectorParameters) -> None:
    """What the rail delivered is stored in line and sac or injected; the paper's form misses the sac's share."""
    sample = 2e-7
    inputs = stroke(15_001, sample)
    c = coefficients(injector)
    states = integrate(inputs, (RAIL, 0.0, 0.0), sample, 1, c)
    rate = np.array([phi_and_rate(x, u, c, NO_FAULT)[1] for x, u in zip(states, inputs, strict=True)])
    p_0, q_0 = injector.scaling.pressure, injector.scaling.flow
    in_line = injector.line.volume / injector.fluid.bulk_modulus_line * p_0 * (states[:, 0] - RAIL)
    in_sac = injector.nozzle.sac_volume / injector.fluid.bulk_modulus_sac * p_0 * states[:, 2]
    delivered = _integral(states[:, 1] * q_0, sample)
    injected = _integral(rate, sample)
    balance = delivered - injected - in_line
    if injector.line_outflow is LineOutflow.SEAT:
        balance -= in_sac
    assert injected[-1] > 0.1e-6  # m3: over 80 mg went through
    assert np.abs(balance).max() < 1e-6 * injected[-1]
    assert in_sac.max() > 1e-3 * injected[-1]  # so that the two forms are told apart


def _integral(values: Array, sample: float) -> Array:
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1])) * sample])


@pytest.mark.parametrize(("v_h", "v_s"), [(0.0, 0.0), (0.4, -0.3), (-0.5, 0.4)])
def test_injection_agrees_with_another_integration(injector: InjectorParameters, v_h: float, v_s: float) -> None:
    """(19)-(23) in physical units by an implicit method with tight tolerances, from the same inputs."""
    inputs = stroke(401, SAMPLE)
    c = coefficients(injector)
    expected = _by_scipy(injector, inputs, v_h, v_s)
    network = constant_network(v_h, v_s)
    fine = integrate(inputs, (RAIL, 0.0, 0.0), SAMPLE, 64, c, network)
    # once the sac has emptied, the line alone swings on in steps of a tenth of a radian
    empty = (fine[:, 2] == 0.0) & (np.arange(len(inputs)) > np.flatnonzero(inputs[:, 1])[-1])
    assert empty[-50:].all()
    np.testing.assert_allclose(fine[~empty], expected[~empty], atol=2e-7)
    np.testing.assert_allclose(fine[empty], expected[empty], atol=5e-6)
    usual = integrate(inputs, (RAIL, 0.0, 0.0), SAMPLE, substeps_needed(injector, 100e3), c, network)
    # the opening sac moves fastest: 1e-4 of p_0 there is 0.01 MPa, a tenth of the sensors' noise
    assert np.abs(usual - expected)[:, :2].max() < 1e-4
    assert np.abs(usual - expected)[:, 2].max() < 5e-3


@pytest.mark.parametrize(("fuel", "rail"), [("en590", 0.35), ("en590", 1.45), ("n-dodecane", 0.95)])
def test_parabolas_inject_what_the_exact_laws_do(fuel: str, rail: float) -> None:
    """Density and stiffness everywhere those of the pressure there, friction's density too: .06 % of the mass."""
    injector = filled(load_injector().model_copy(update={"line_outflow": LineOutflow.SEAT}), fuel)
    inputs, c = stroke(401, SAMPLE) * np.array([rail / RAIL, 1.0]), coefficients(injector)
    states = integrate(inputs, (rail, 0.0, 0.0), SAMPLE, substeps_needed(injector, 100e3), c)
    expected = _by_scipy(injector, inputs, 0.0, 0.0)
    volume = sum(phi_and_rate(x, u, c, NO_FAULT)[1] for x, u in zip(states, inputs, strict=True))
    exact = sum(physical_rates(x, u, 0.0, 0.0, injector)[1] for x, u in zip(expected, inputs, strict=True))
    assert volume == pytest.approx(exact, rel=7e-4)
    assert np.abs(states - expected)[:, 0].max() < 0.005 * np.ptp(expected[:, 0])


def _by_scipy(injector: InjectorParameters, inputs: Array, v_h: float, v_s: float) -> Array:
    grid = np.arange(len(inputs)) * SAMPLE

    def rates(time: float, x: Array) -> tuple[float, ...]:
        u = float(np.interp(time, grid, inputs[:, 0])), float(np.interp(time, grid, inputs[:, 1]))
        return physical_rates((x[0], x[1], x[2]), u, v_h, v_s, injector)[0]

    start: State = (float(inputs[0, 0]), 0.0, 0.0)
    pieces = [np.array([start])]
    corners = [0, 50, 75, 200, 225, len(inputs) - 1]  # where the inputs bend
    for first, last in pairwise(corners):
        span, method = grid[first : last + 1], "Radau" if first in (0, 225) else "LSODA"
        solution = solve_ivp(rates, (span[0], span[-1]), pieces[-1][-1], method, span, rtol=1e-10, atol=1e-11)
        pieces.append(solution.y.T[1:])
    return np.concatenate(pieces)


@pytest.mark.parametrize("sample", [1e-5, 5e-5])
def test_fewer_steps_at_rest_follow_the_line_as_well(injector: InjectorParameters, sample: float) -> None:
    """A ringing line behind a shut needle, for 20 ms: amplitude and phase stay within 1e-4 of p_0."""
    count = round(20e-3 / sample)
    c = coefficients(injector)
    inputs = np.column_stack([np.full(count, RAIL), np.zeros(count)])
    start = (RAIL + 0.1, 0.0, 0.0)
    usual = integrate(inputs, start, sample, substeps_needed(injector, 1 / sample), c)
    fine = integrate(inputs + np.array([0.0, 1e-15]), start, sample, 100, c)  # too small to matter, but not shut
    assert np.abs(usual[:, 0] - fine[:, 0]).max() < 1e-4
