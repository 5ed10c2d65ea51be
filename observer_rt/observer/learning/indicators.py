"""Wear of nozzle and seat, and line-side and sensor matters, as numbers with a standard deviation."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.learned import network_of
from observer_rt.estimation.sensitivity import PARAMETERS, Parameter
from observer_rt.model.coefficients import Coefficients
from observer_rt.model.network import HIDDEN, activation, back_pressure_at, flow_changes
from observer_rt.model.orifice import root
from observer_rt.model.sensor import LAG_UNIT
from observer_rt.observer.paper_scheme.network import FreeNetwork, free_fault

LEAST_SAC_PRESSURE = 0.05  # of p_0, below which a change of the nozzle flow is not spoken of


@dataclass(frozen=True)
class Estimate:
    """A number and its standard deviation, None where nothing was learned yet."""

    value: float
    sigma: float | None = None

    @property
    def ci95(self) -> tuple[float, float] | None:
        """95 % interval."""
        if self.sigma is None:
            return None
        return self.value - 1.96 * self.sigma, self.value + 1.96 * self.sigma


@dataclass(frozen=True)
class Indicators:
    """What the parameters say of the injector at one operating point.

    nozzle, seat: equivalents of v_H and v_S in (27). Line-side and sensor matters, none of which enters Q_H^:
    friction k, leakage c p_0 / Q_0, bulk modulus r, line pressure offset o in units of p_0, lag in s, air K g / p_0.
    """

    nozzle: Estimate
    seat: Estimate
    line_friction: Estimate
    guide_leakage: Estimate
    bulk_modulus: Estimate
    line_pressure_offset: Estimate
    line_pressure_lag: Estimate
    entrained_air: Estimate


def indicators_of(
    theta: NDArray[np.float64],
    covariance: NDArray[np.float64] | None,
    x: NDArray[np.float64],
    u: NDArray[np.float64],
) -> Indicators:
    """Indicators for theta (m,) at state x (3,) and inputs u (2,), sigmas from its covariance (m, m)."""
    state = (float(x[0]), float(x[1]), float(x[2]))
    inputs = (float(u[0]), float(u[1]))
    nozzle, slopes = nozzle_change(theta, state, inputs)

    def scalar(parameter: Parameter, unit: float = 1.0) -> Estimate:
        value = float(theta[parameter]) * unit
        if covariance is None:
            return Estimate(value)
        return Estimate(value, float(np.sqrt(covariance[parameter, parameter])) * unit)

    return Indicators(
        nozzle=Estimate(nozzle, None if covariance is None else float(np.sqrt(slopes @ covariance @ slopes))),
        seat=scalar(Parameter.SEAT_BIAS),
        line_friction=scalar(Parameter.LINE_FRICTION),
        guide_leakage=scalar(Parameter.GUIDE_LEAKAGE),
        bulk_modulus=scalar(Parameter.BULK_MODULUS),
        line_pressure_offset=scalar(Parameter.LINE_PRESSURE_OFFSET),
        line_pressure_lag=scalar(Parameter.SENSOR_LAG, LAG_UNIT),
        entrained_air=scalar(Parameter.ENTRAINED_AIR),
    )


def nozzle_change(
    theta: NDArray[np.float64], x: tuple[float, float, float], u: tuple[float, float]
) -> tuple[float, NDArray[np.float64]]:
    """Relative change of the nozzle flow at a state with an open needle, and its derivatives (PARAMETERS,).

    (1 + N_H) sqrt((x3 - d)/x3) - 1: network and back-pressure d together, the equivalent of v_H in (27).
    """
    network = network_of(theta)
    factor = 1.0 + flow_changes(x, u, network)[0]
    x_3 = max(x[2], LEAST_SAC_PRESSURE)
    against_chamber = math.sqrt(max(1.0 - back_pressure_at(u[1], network) / x_3, 0.0))
    slopes = np.zeros(PARAMETERS)
    slopes[Parameter.NOZZLE_BIAS] = against_chamber
    for neuron in range(HIDDEN):
        sigma = activation(x, u, network.hidden, neuron)
        slopes[Parameter.NOZZLE_WEIGHT + neuron] = against_chamber * sigma
    if against_chamber > 0.0:
        slopes[Parameter.BACK_PRESSURE] = -0.5 * factor / (x_3 * against_chamber)
        slopes[Parameter.BACK_PRESSURE + 1] = slopes[Parameter.BACK_PRESSURE] * u[1]
    return factor * against_chamber - 1.0, slopes


def with_free_rows(
    indicators: Indicators,
    network: FreeNetwork,
    x: NDArray[np.float64],
    u: NDArray[np.float64],
    c: Coefficients,
) -> Indicators:
    """Indicators where phi is the paper's: v_H of (27) from phi_1 at state x (3,) and inputs u (2,), no sigma."""
    phi_1, _, _ = free_fault((float(x[0]), float(x[1]), float(x[2])), (float(u[0]), float(u[1])), network)
    flow = c.line.a2_nozzle * root(float(x[2]), c.nozzle.transition)
    return replace(indicators, nozzle=Estimate(-phi_1 / flow if flow > 0.0 else 0.0))
