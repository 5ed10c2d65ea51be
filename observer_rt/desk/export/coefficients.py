"""Effective coefficients of a frozen observer with units and meaning, and the equations they stand in, as text."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from observer_rt.desk.export.frozen import Frozen
from observer_rt.model.line.wave import WaveLine


class EffectiveCoefficient(NamedTuple):
    """A number of the model, with effects and what was learned."""

    name: str
    value: float
    unit: str
    meaning: str


_LINE: Mapping[str, tuple[str, str]] = {
    "a1": ("1/s", "line filled by Q_L"),
    "a2_nozzle": ("1/s", "line drained by Q_H"),
    "a2_seat": ("1/s", "line drained by Q_S"),
    "a3": ("1/s", "inertia"),
    "a3_near": ("1/s", "inertia, in the part at the injector"),
    "a4": ("1/s", "friction"),
    "a4_inlet": ("1/s", "friction of a throttle at the rail"),
    "memory": ("1/s^0.5", "friction that remembers"),
    "b": ("1/s", "compliance of a cell"),
    "b_near": ("1/s", "compliance of a cell, in the part at the injector"),
    "damping": ("1/s", "what evens out the flows of neighbouring faces"),
    "leak": ("1/s", "line drained by p_L - p_C"),
    "air": ("-", "entrained air, K g/p_0"),
    "stiffness_slope": ("-", "n p_0/K_L of a bulk modulus that grows with pressure"),
    "stiffness_pressure": ("-", "(p - p_C)/p_0 at which it is K_L"),
    "chamber_pressure": ("-", "p_C/p_0"),
    "cells": ("-", "cells of the line"),
    "joint": ("-", "where its parts meet, in cells from the rail"),
}
NORMALISED = (
    "x1 = (p_L - p_C)/p_0, x2 = Q_L/Q_0, x3 = (p_S - p_C)/p_0, u1 = (p_R - p_C)/p_0, u2 = A_S(x_N)/A_0",
    "A_S = pi x_N sin(b) (d_S - x_N/2 sin(2 b)) (1 - loss exp(-x_N/loss_lift))",
    "root(d) = d/(d^2 + transition^2)^(1/4)",
    "N_H, N_S = W tanh(V [x1 x2 x3 u1 u2 1]) + bias",
    "rise = (chamber_rise + chamber_rise_with_seat u2 + learned_rise + learned_rise_with_seat u2) where u2 > 0",
    "q_H = root(x3 - rise) (1 + N_H), below the critical cavitation number times sqrt(N/N_crit)",
    "q_S = u2 root(x1 - x3) (1 + N_S)",
)
SAC = ("x3' = a5 q_S - a6 q_H", "Q_H = nozzle_flow q_H")
LUMP = (
    "K/K_L = (1 + stiffness_slope (x1 - stiffness_pressure)), with air softer by p/(p + K/K_L air)",
    "x1' = K/K_L (a1 x2 - a2_nozzle q_H - a2_seat q_S - leak x1)",
    "x2' = a3 (u1 - x1) - a4 x2 |x2|",
)
WAVE = (
    "q_i' = a3 (p_(i-1) - p_i) - a4 q_i |q_i| + damping (q_(i-1) - 2 q_i + q_(i+1)), i = 1 .. cells",
    "p_0 = u1, q_cells = x2",
    "p_i' = b (q_i - q_(i+1)), i = 1 .. cells - 1",
    "x1' = a1 x2 - a2_nozzle q_H - a2_seat q_S - leak x1, x1 = p_cells",
    "all p' times K/K_L = (1 + stiffness_slope (p - stiffness_pressure)), with air softer by p/(p + K/K_L air)",
    "beyond the joint a3_near and b_near; at the first face a4 + a4_inlet; memory: friction by past changes of flow",
)


def effective_coefficients(frozen: Frozen) -> Sequence[EffectiveCoefficient]:
    """All of them, those of the line first."""
    return tuple(EffectiveCoefficient(*row) for row in _rows(frozen))


def equations(frozen: Frozen) -> Sequence[str]:
    """Equations of the model as text, laws of its own last."""
    line = WAVE if isinstance(frozen.line, WaveLine) else LUMP
    return (*NORMALISED, *line, *SAC, *map(str, frozen.terms))


def _rows(frozen: Frozen) -> Iterator[tuple[str, float, str, str]]:
    c, sensor, inputs = frozen.constants.coefficients, frozen.sensor, frozen.constants.inputs
    for name in frozen.line._fields:
        if name in _LINE:
            yield name, float(getattr(frozen.line, name)), *_LINE[name]
    yield "a5", c.sac.a5, "1/s", "sac filled by Q_S"
    yield "a6", c.sac.a6, "1/s", "sac drained by Q_H"
    yield "nozzle_flow", c.nozzle.flow, "m3/s", "Q_H at p_0"
    yield "transition", c.nozzle.transition, "-", "of p_0, below which orifices are laminar"
    yield (
        "critical_excess",
        c.nozzle.critical_excess,
        "-",
        "N_crit - 1 of a nozzle that cavitates, 0: it does not",
    )
    yield "vapour_margin", c.nozzle.vapour_margin, "-", "(p_C - p_v)/p_0"
    yield "chamber_rise", c.nozzle.chamber_rise, "-", "of p_C while the needle is open, of p_0"
    yield "chamber_rise_with_seat", c.nozzle.chamber_rise_with_seat, "-", "the same for every unit of u2"
    yield "learned_rise", float(frozen.network.nozzle[0]), "-", "the same, learned"
    yield (
        "learned_rise_with_seat",
        float(frozen.network.nozzle[1]),
        "-",
        "the same, learned, for every unit of u2",
    )
    yield "seat_diameter", c.seat.diameter, "m", "d_S"
    yield "half_cone_angle", c.seat.half_cone_angle, "rad", "b"
    yield "loss", c.seat.loss, "-", "of the seat's flow coefficient at low lift"
    yield "loss_lift", c.seat.loss_lift, "m", "lift over which it fades"
    yield "p_0", c.pressure_scale, "Pa", "scale of pressures"
    yield "Q_0", c.flow_scale, "m3/s", "scale of flows"
    yield "A_0", c.area_scale, "m2", "scale of areas"
    yield "p_C", c.chamber_pressure, "Pa", "chamber pressure"
    yield "rho_C", c.density, "kg/m3", "density in the nozzle"
    yield "rail_factor", inputs.rail_factor, "-", "true rail pressure = factor x measured + shift"
    yield "rail_shift", inputs.rail_shift, "Pa", "the same"
    yield "lift_factor", inputs.lift_factor, "-", "true lift = factor x measured + shift, of an open needle"
    yield "lift_shift", inputs.lift_shift, "m", "the same"
    yield "sensor_lag", sensor.lag, "s", "time constant of the line-pressure sensor"
    yield "sensor_offset", sensor.offset * c.pressure_scale, "Pa", "its offset"
    yield (
        "sensor_delay",
        (sensor.late + sensor.fraction) * frozen.constants.interval,
        "s",
        "by which it is recorded late",
    )
