"""Stability of the integration: steps of the sac in a sample interval, and cells of a line that its steps allow."""

import math

from observer_rt.core.model.model import steps_in
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MICROSECOND
from observer_rt.model.effective import Coefficients, EffectiveModel, coefficients
from observer_rt.model.fuel import HIGHEST_PRESSURE
from observer_rt.model.hydraulics import full_lift_area
from observer_rt.model.line import stiffened
from observer_rt.model.parameters import FEWEST_CELLS, NO_DEPARTURES, Departures, InjectorParameters
from observer_rt.model.wave_line import STABLE, WaveLine, cells_for

OVERSHOOT = 1.2  # of the rail pressure, that the closed end of a line reaches when a needle shuts

RK4_LIMIT = 2.6  # step * fastest rate; RK4 is stable to 2.78 on the negative real axis
MAX_SUBSTEPS = 64  # beyond this a sample costs more than it is worth: the sample rate is too low


def refuse_unstable_cells(
    file: str, injector: InjectorParameters, coefficients: Coefficients, interval: float
) -> None:
    """Raise `UserError`, naming the injector `file`, if a sample interval [s] gives steps too long for the cells."""
    line = coefficients.line
    strain = line.strain(interval)
    if strain >= STABLE:
        step = interval / steps_in(interval)
        raise UserError(
            f"{file}: line.cells",
            f"{line.cells:.0f} cells are not stable: sound crosses {line.crossing * step:.3g} of a cell in a step of "
            f"{step / MICROSECOND:.3g} us and {2.0 * line.damping * step:.2g} is left of it to damping, together "
            f"{strain:.3g} (at most {STABLE:g})",
            f"give {cells_for(injector, step)} cells, or leave 'cells' out",
        )


def in_stable_cells(model: EffectiveModel, interval: float, highest_pressure: float) -> EffectiveModel | None:
    """The model with as many of its cells as are stable at an interval [s]; None if the fewest are not.

    highest_pressure [Pa] of the rail, times OVERSHOOT: stiffening fuel is stiffest there.
    """
    while (strain := _strain(model, interval, highest_pressure)) >= STABLE:
        cells = int(model.coefficients.line.cells)
        if cells <= FEWEST_CELLS:
            return None
        fewer = max(FEWEST_CELLS, min(cells - 1, int(cells * (STABLE / strain) ** 0.5)))
        model = model.with_changes("line", cells=fewer)
    return model


def _strain(model: EffectiveModel, interval: float, highest_pressure: float) -> float:
    """`strain` of a line at the highest pressure, which must stay below STABLE; 0 for a line without cells."""
    line = model.coefficients.line
    if not isinstance(line, WaveLine):
        return 0.0
    if line.stiffness_bend != 0.0:
        return line.strain(interval)
    normalised = OVERSHOOT * highest_pressure / model.coefficients.pressure_scale
    stiffer = max(0.0, line.stiffness_slope * (normalised - line.stiffness_pressure))
    return float(stiffened(line, stiffer).strain(interval))


def fastest_rate(parameters: InjectorParameters, c: Coefficients) -> float:
    """Upper bound of the fastest rate [1/s] in a model, at full lift and any pressure.

    The orifice laws are steepest, 1/sqrt(t), at zero pressure difference; seat and nozzle act in parallel. Fuel is
    stiffest, and passes the seat densest, at the highest pressure.
    """
    area = full_lift_area(parameters) / c.area_scale * (1.0 + max(-c.seat.loss, 0.0))
    fuel, chamber = parameters.fluid.in_sac, parameters.chamber.pressure
    stiffer = fuel.filling(HIGHEST_PRESSURE) / fuel.filling(chamber)
    stiffer *= math.sqrt(fuel.density(HIGHEST_PRESSURE) / fuel.density(chamber))
    seat = (stiffer * c.sac.a5 + c.line.a2_seat) * area  # a seat that drains the line is faster
    return float(max((seat + c.sac.a6) / math.sqrt(c.seat.transition), c.line.fastest))


def substeps_needed(
    parameters: InjectorParameters, sample_rate: float, departures: Departures = NO_DEPARTURES
) -> int:
    """Steps of the sac per sample interval that keep it stable; may exceed `MAX_SUBSTEPS`."""
    c = coefficients(parameters, departures)
    wanted = max(1, math.ceil(fastest_rate(parameters, c) / (RK4_LIMIT * sample_rate)))
    return int(c.line.substeps(wanted, 1.0 / sample_rate))
