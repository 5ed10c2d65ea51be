"""Shared by the tests of the model: an injector in both outflow forms, and trajectories over given inputs."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from observer_rt.config.bench import FUELS, load_injector
from observer_rt.config.toml_file import read_toml
from observer_rt.core.model.model import advance_state, rest_state
from observer_rt.model.effective import Coefficients
from observer_rt.model.network import Network, constant_network
from observer_rt.model.parameters import Fluid, InjectorParameters, LineOutflow
from tests.intervals import Interval
from tests.plants.arrays import Array

State = tuple[float, float, float]
GAUSS = [(0.5 + 0.5 * at, 0.5 * w) for at, w in zip(*np.polynomial.legendre.leggauss(5), strict=True)]


@pytest.fixture(params=list(LineOutflow), ids=str)
def injector(request: pytest.FixtureRequest) -> InjectorParameters:
    """The nominal injector with the line drained by the nozzle flow, then by the seat flow."""
    return load_injector().model_copy(update={"line_outflow": request.param})


def integrate(
    inputs: Array, start: State, interval: float, substeps: int, c: Coefficients, network: Network | None = None
) -> Array:
    """States (n, 3) at the samples of inputs (n, 2), linear between them, from a start state."""
    states = np.empty((len(inputs), c.states))
    states[0] = start
    network = network or constant_network()
    for n in range(len(inputs) - 1):
        u_start = (float(inputs[n, 0]), float(inputs[n, 1]))
        u_end = (float(inputs[n + 1, 0]), float(inputs[n + 1, 1]))
        states[n + 1] = states[n]
        advance_state(states[n + 1], Interval(u_start, u_end, interval, substeps), c, network)
    return states


def with_line(injector: InjectorParameters, **line: Any) -> InjectorParameters:
    return injector.model_copy(update={"line": injector.line.model_copy(update=line)})


def at_rest(c: Coefficients, pressure: float = 0.95) -> Array:
    x = np.zeros(c.states)
    rest_state(x, pressure, c)
    return x


def filled(injector: InjectorParameters, fuel: str | None) -> InjectorParameters:
    return injector.model_copy(update={"fluid": Fluid(**read_toml(FUELS)[fuel])}) if fuel else injector


def advanced(
    x: State, interval: Interval, c: Coefficients, network: Network, knot: tuple[float, float] = (0.0, 0.0)
) -> State:
    state = np.array(x)
    advance_state(state, interval, c, network, knot=knot)
    return float(state[0]), float(state[1]), float(state[2])


def physical_rates(
    x: Sequence[float], u: Sequence[float], v_h: float, v_s: float, injector: InjectorParameters
) -> tuple[tuple[float, float, float], float]:
    """(19)-(23) in SI units with wear, normalised at the end; and Q_H [m3/s]. Fuel that stiffens is so everywhere."""
    fluid, line, seat, nozzle = injector.fluid, injector.line, injector.seat, injector.nozzle
    p_0, q_0, area_0 = injector.scaling.pressure, injector.scaling.flow, injector.scaling.area
    p_c, k_1 = injector.chamber.pressure, fluid.bulk_modulus_by_pressure
    p_l, q_l, p_s = x[0] * p_0 + p_c, x[1] * q_0, x[2] * p_0 + p_c
    p_r, area_s = u[0] * p_0 + p_c, u[1] * area_0
    area_l = math.pi / 4 * line.diameter**2
    area_h = nozzle.holes * math.pi / 4 * nozzle.hole_diameter**2

    def denser(pressure: float, modulus: float) -> float:
        return (1 + k_1 * pressure / modulus) ** (1 / k_1) if k_1 else 1.0

    def filling(pressure: float, modulus: float) -> float:
        return (modulus + k_1 * pressure) / denser(pressure, modulus)

    def orifice(before: float, behind: float) -> float:
        drop, modulus = before - behind, fluid.bulk_modulus_sac
        lightness = sum(w / denser(behind + drop * at, modulus) for at, w in GAUSS)  # Bernoulli's integral of dp/rho
        speed = drop / math.sqrt(math.hypot(drop, 0.5e6)) * math.sqrt(2 / fluid.density_nozzle * lightness)
        return denser(behind, modulus) * speed

    q_s = (1 + v_s) * seat.flow_coefficient * area_s * orifice(p_l, p_s)
    alpha_h = nozzle.flow_coefficient * (1 + nozzle.coefficient_by_pressure * ((p_s - p_c) / 100e6 - 1))
    q_h = (1 + v_h) * alpha_h * area_h * orifice(p_s, p_c)
    drain = q_s if injector.line_outflow is LineOutflow.SEAT else q_h
    rates = (
        filling(p_l, fluid.bulk_modulus_line) / line.volume * (q_l - drain) / p_0,
        (
            area_l / (fluid.density_line * line.length) * (p_r - p_l)
            - line.loss_factor / (2 * area_l * line.length) * q_l * abs(q_l) / denser(p_l, fluid.bulk_modulus_line)
        )
        / q_0,
        filling(p_s, fluid.bulk_modulus_sac) / nozzle.sac_volume * (q_s - q_h) / p_0,
    )
    return rates, q_h
