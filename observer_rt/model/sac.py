"""The sac: its pressure (22), filled through the seat and drained through the nozzle."""

from typing import NamedTuple

from numba import njit

from observer_rt.model.parameters import InjectorParameters


class Sac(NamedTuple):
    """Coefficients of the sac [1/s]; the law is linear, they are its slopes."""

    a5: float  # filled through the seat
    a6: float  # drained through the nozzle


def sac_of(parameters: InjectorParameters, nozzle_flow: float, seat_flow: float) -> Sac:
    """The sac of an injector; nozzle_flow, seat_flow: Q_H and Q_S [m3/s] at a normalised flow of 1."""
    stiffness = parameters.fluid.bulk_modulus_sac / parameters.nozzle.sac_volume / parameters.scaling.pressure
    return Sac(stiffness * seat_flow, stiffness * nozzle_flow)


@njit(cache=True, nogil=True, inline="always")
def sac_rate(q_h: float, q_s: float, sac: Sac) -> float:
    """p_S' of (22), normalised [1/s]."""
    return sac.a5 * q_s - sac.a6 * q_h
