"""Hydraulics of the injector, (21)-(23): coefficients of pilot valve, seat, sac and nozzle, of laws in core.model.

The pilot valve of a servo injector takes fuel out of the line's end: it drains the control chamber into the return,
    G(t) (c sqrt(p_L / 100 MPa) + A_c dx/dt) of a rising needle,
from before the needle leaves its seat to before it begins to fall: both earlier the lower the rail pressure, as
(p_R / 100 MPa)^-n. Where the injector's command is known, it opens and shuts some time after its edges. The equations
are `core/model/valve.pxd` and `core/model/servo.pxi`; none of that fuel is injected.
"""

import math

from observer_rt.core.model import model
from observer_rt.core.model.laws import seat_area
from observer_rt.core.model.needle import NeedleLaw
from observer_rt.model.fuel import USUAL_PRESSURE, parabola
from observer_rt.model.parameters import Departures, InjectorParameters

CONTROL_START, CONTROL_END, CONTROL_EDGE = 0.25e-3, 0.20e-3, 20e-6  # s, of an injector whose file does not state them
COMMAND_DELAY = 0.1e-3  # s, after both edges of the injector's command
CONTROL_REFERENCE = 100e6  # Pa, of the line and of the rail, to which flow and times belong
TRANSITION_PRESSURE = 0.5e6  # Pa, below which the orifice laws turn linear


class Valve(model.Valve):
    """Pilot valve: the times at which it is open, and how its flow changes."""

    __slots__ = ()

    def by_commands(self, needle: NeedleLaw | None = None) -> "Valve":
        """The valve by commands: `COMMAND_DELAY` after them, or ahead of a needle by commands as its file says."""
        start = end = -COMMAND_DELAY
        if needle is not None:
            start = self.start - needle.opening_delay - model.LIFT_OFF / needle.opening_speed
            end = self.end - needle.closing_delay - model.LIFT_OFF / needle.closing_speed
        return Valve(start, end, self.hold, exponent=0.0, edge=self.edge, commanded=1.0)


def valve_of(parameters: InjectorParameters) -> Valve:
    """The valve of an injector's file."""
    line = parameters.line
    start = CONTROL_START if line.control_start is None else line.control_start
    end = CONTROL_END if line.control_end is None else line.control_end
    edge = line.control_edge or CONTROL_EDGE
    return Valve(start, end, line.control_hold or 0.0, line.control_exponent or 0.0, edge, commanded=0.0)


def jet_velocity(parameters: InjectorParameters) -> float:
    """Velocity [m/s] of a jet at p_0 into the chamber, as flow counted at rho_0 over its area."""
    denser = parameters.fluid.in_sac.density(parameters.chamber.pressure)
    return math.sqrt(2 * parameters.scaling.pressure / parameters.fluid.density_nozzle * denser)


def seat_of(parameters: InjectorParameters, departures: Departures) -> model.Seat:
    """The seat of an injector."""
    p_0, p_c = parameters.scaling.pressure, parameters.chamber.pressure
    _, *denser = parabola(lambda pressure: math.sqrt(parameters.fluid.in_sac.density(pressure)), p_c, p_0)
    return model.Seat(
        transition=TRANSITION_PRESSURE / p_0,
        area_scale=parameters.scaling.area,
        diameter=parameters.seat.diameter,
        half_cone_angle=math.radians(parameters.seat.cone_angle / 2),
        loss=departures.seat_loss,
        loss_lift=departures.seat_loss_lift,
        density_slope=denser[0],
        density_bend=denser[1],
    )


def full_lift_area(parameters: InjectorParameters) -> float:
    """Seat area A_S at the needle's stop [m2]."""
    seat = parameters.seat
    return seat_area(seat.max_lift, seat.diameter, math.radians(seat.cone_angle / 2))


def nozzle_of(parameters: InjectorParameters, departures: Departures) -> model.Nozzle:
    """The nozzle of an injector."""
    p_0, p_c, area = parameters.scaling.pressure, parameters.chamber.pressure, parameters.scaling.area
    nozzle = parameters.nozzle

    def jet_before(pressure: float) -> float:
        coefficient = 1.0 + nozzle.coefficient_by_pressure * ((pressure - p_c) / USUAL_PRESSURE - 1.0)
        return coefficient * parameters.fluid.in_sac.jet(p_c, pressure)

    value, *jet = parabola(jet_before, p_c, p_0)
    return model.Nozzle(
        transition=TRANSITION_PRESSURE / p_0,
        flow=nozzle.flow_coefficient * nozzle.area * jet_velocity(parameters) * value,
        critical_excess=departures.critical_excess,
        vapour_margin=(p_c - parameters.fluid.vapour_pressure) / p_0,
        chamber_rise=departures.chamber_rise / p_0,
        chamber_rise_with_seat=departures.chamber_rise_with_seat / p_0 * area / full_lift_area(parameters),
        jet_slope=jet[0],
        jet_bend=jet[1],
    )


def sac_of(parameters: InjectorParameters, nozzle_flow: float, seat_flow: float) -> model.Sac:
    """The sac of an injector; nozzle_flow, seat_flow: Q_H and Q_S [m3/s] at a normalised flow of 1."""
    scale = parameters.scaling.pressure
    filling, *bent = parabola(parameters.fluid.in_sac.filling, parameters.chamber.pressure, scale)
    stiffness = filling / parameters.nozzle.sac_volume / scale
    return model.Sac(stiffness * seat_flow, stiffness * nozzle_flow, *bent)
