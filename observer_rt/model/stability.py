"""How many integration steps a sample interval needs."""

import math

from observer_rt.model.coefficients import Coefficients, coefficients
from observer_rt.model.departures import NO_DEPARTURES, Departures
from observer_rt.model.line.interface import line_fastest
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.seat import full_lift_area

RK4_LIMIT = 2.6  # step * fastest rate; RK4 is stable to 2.78 on the negative real axis
MAX_SUBSTEPS = 64  # beyond this a sample costs more than it is worth: the sample rate is too low


def fastest_rate(parameters: InjectorParameters, departures: Departures = NO_DEPARTURES) -> float:
    """Upper bound of the fastest rate [1/s] in a model, at full lift and any pressure.

    The orifice laws are steepest, 1/sqrt(t), at zero pressure difference; seat and nozzle act in parallel.
    """
    return _fastest_rate(parameters, coefficients(parameters, departures))


def _fastest_rate(parameters: InjectorParameters, c: Coefficients) -> float:
    area = full_lift_area(parameters) / c.area_scale * (1.0 + max(-c.seat.loss, 0.0))
    seat = (c.sac.a5 + c.line.a2_seat) * area  # a seat that drains the line is faster
    of_sac = (seat + c.sac.a6) / math.sqrt(c.seat.transition)
    return float(max(of_sac, line_fastest(c.line)))


def substeps_needed(
    parameters: InjectorParameters, sample_rate: float, departures: Departures = NO_DEPARTURES
) -> int:
    """Steps of the sac per sample interval that keep the integration stable at `sample_rate` [Hz].

    The number may exceed `MAX_SUBSTEPS`; whether to refuse that is the caller's decision.
    """
    c = coefficients(parameters, departures)
    wanted = max(1, math.ceil(_fastest_rate(parameters, c) / (RK4_LIMIT * sample_rate)))
    return int(c.line.substeps(wanted, 1.0 / sample_rate))
