"""The sac: its pressure (22), filled through the seat and drained through the nozzle."""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import inlined
from observer_rt.model.parameters import InjectorParameters

EMPTY_SAC = 1e-7  # of p_0: a shut, drained sac this close to chamber pressure is at it


class Sac(NamedTuple):
    """Coefficients of the sac [1/s]; the law is linear, they are its slopes."""

    a5: float  # filled through the seat
    a6: float  # drained through the nozzle


def sac_of(parameters: InjectorParameters, nozzle_flow: float, seat_flow: float) -> Sac:
    """The sac of an injector; nozzle_flow, seat_flow: Q_H and Q_S [m3/s] at a normalised flow of 1."""
    stiffness = parameters.fluid.bulk_modulus_sac / parameters.nozzle.sac_volume / parameters.scaling.pressure
    return Sac(stiffness * seat_flow, stiffness * nozzle_flow)


@inlined
def sac_rate(q_h: float, q_s: float, sac: Sac) -> float:
    """p_S' of (22), normalised [1/s]."""
    return sac.a5 * q_s - sac.a6 * q_h


@inlined
def empty_if_drained(
    x: NDArray[np.float64], u_start: tuple[float, float], u_end: tuple[float, float], tangent: Any
) -> None:
    """A sac that has drained behind a shut needle is at exactly chamber pressure."""
    if u_start[1] <= 0.0 and u_end[1] <= 0.0 and math.fabs(x[2]) < EMPTY_SAC:
        empty_sac(x, tangent)


@inlined
def empty_sac(x: NDArray[np.float64], tangent: Any) -> None:
    """p_S is at chamber pressure, whatever the parameters."""
    x[2] = 0.0
    if tangent is not None:
        tangent.by[2, :] = 0.0
