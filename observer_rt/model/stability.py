"""How many integration steps a sample interval needs."""

import math

from observer_rt.model.coefficients import Coefficients, coefficients
from observer_rt.model.departures import NO_DEPARTURES, Departures
from observer_rt.model.line.interface import line_fastest
from observer_rt.model.line.wave import steps_over
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.seat import full_lift_area

RK4_LIMIT = 2.6  # step * fastest rate; RK4 is stable to 2.78 on the negative real axis
MOST_OF_A_STEP = 8  # implicit steps of the sac in one of the line's
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
    return float(of_sac if c.line.staggered else max(of_sac, line_fastest(c.line)))


def substeps_needed(
    parameters: InjectorParameters, sample_rate: float, departures: Departures = NO_DEPARTURES
) -> int:
    """Steps of the sac per sample interval that keep the integration stable at `sample_rate` [Hz].

    The number may exceed `MAX_SUBSTEPS`; whether to refuse that is the caller's decision. Beside a staggered line
    steps are implicit: a few of each of the line's while they resolve the sac, one of a sac too fast for that.
    """
    c = coefficients(parameters, departures)
    wanted = max(1, math.ceil(_fastest_rate(parameters, c) / (RK4_LIMIT * sample_rate)))
    if not c.line.staggered:
        return wanted
    steps: int = steps_over(1.0 / sample_rate)
    each = math.ceil(wanted / steps)
    return steps * (each if each <= MOST_OF_A_STEP else 1)
