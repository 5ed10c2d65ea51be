"""The normalised coefficients of (25), element by element, from physical parameters."""

from typing import Any, NamedTuple

from observer_rt.model.hydraulics import Nozzle, Sac, Seat, nozzle_of, sac_of, seat_flow_scale, seat_of
from observer_rt.model.line.interface import line_of
from observer_rt.model.parameters import NO_DEPARTURES, Departures, InjectorParameters


class Coefficients(NamedTuple):
    """What the compiled right-hand side needs; rates in 1/s for states normalised by (24)."""

    line: Any  # a `Line`
    seat: Seat
    nozzle: Nozzle
    sac: Sac
    pressure_scale: float  # p_0, Pa
    flow_scale: float  # Q_0, m3/s
    area_scale: float  # A_0, m2
    chamber_pressure: float  # p_C, Pa
    density: float  # rho_C, kg/m3, turns injected volume into mass
    compression: float  # p_0/K_L, of the nominal line

    @property
    def states(self) -> int:
        """Of the whole: p_L, Q_L, p_S and the line's further ones."""
        return 3 + int(self.line.further)


def coefficients(parameters: InjectorParameters, departures: Departures = NO_DEPARTURES) -> Coefficients:
    """Coefficients of (25) and the scalings of (24) for an injector.

    Effects in force in `parameters` are not looked at: see `effects.effective_model`.
    """
    nozzle = nozzle_of(parameters, departures)
    seat_flow = seat_flow_scale(parameters)
    return Coefficients(
        line=line_of(parameters, departures, nozzle.flow, seat_flow),
        seat=seat_of(parameters, departures),
        nozzle=nozzle,
        sac=sac_of(parameters, nozzle.flow, seat_flow),
        pressure_scale=parameters.scaling.pressure,
        flow_scale=parameters.scaling.flow,
        area_scale=parameters.scaling.area,
        chamber_pressure=parameters.chamber.pressure,
        density=parameters.fluid.density_nozzle,
        compression=parameters.scaling.pressure / parameters.fluid.bulk_modulus_line,
    )


def averaged(c: Coefficients) -> Coefficients:
    """The same for samples that are means over the sample period that ends at their time."""
    return c._replace(line=c.line.with_mean())
