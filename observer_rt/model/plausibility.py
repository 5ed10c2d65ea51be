"""Plausible ranges of an injector's numbers, and the entry that is probably wrong if a number lies beyond.

The ranges of geometry are generous, from small car injectors to those of large ships: a value beyond them is most
often in other units than SI. Numbers that a fit determines have physical ranges, because a fit hides wrong geometry
in them. The bulk modulus of diesel fuels follows from their speed of sound, some 1.2 to 2.8 GPa from 15 to 180 MPa
and 298 to 343 K (Payri et al., Fuel 90, 2011). Flow coefficients of holes reach from .61, where the flow separates at
a sharp edge (Kirchhoff: pi/(pi + 2)), to .9 of rounded, conical holes; a seat's is lower if the lift reads too large.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from observer_rt.foundation.units import CUBIC_MILLIMETRE, MILLIMETRE
from observer_rt.model.parameters import InjectorParameters

STIFFNESS = "fluid.bulk_modulus_line"
SEAT, NOZZLE = "seat.flow_coefficient", "nozzle.flow_coefficient"
_PLAUSIBLE = (  # lowest, highest, unit as it is printed
    ("fluid.density_line", 600.0, 1_100.0, " kg/m3"),
    ("fluid.density_nozzle", 600.0, 1_100.0, " kg/m3"),
    (STIFFNESS, 0.9e9, 3e9, " Pa"),
    ("fluid.bulk_modulus_sac", 0.5e9, 5e9, " Pa"),
    ("fluid.vapour_pressure", 0.0, 1e6, " Pa"),
    ("line.length", 10 * MILLIMETRE, 5.0, " m"),
    ("line.diameter", 0.5 * MILLIMETRE, 30 * MILLIMETRE, " m"),
    ("line.volume", 10 * CUBIC_MILLIMETRE, 1e6 * CUBIC_MILLIMETRE, " m3"),
    ("line.loss_factor", 0.0, 1e3, ""),
    (SEAT, 0.3, 1.0, ""),
    ("seat.diameter", 0.5 * MILLIMETRE, 20 * MILLIMETRE, " m"),
    ("seat.cone_angle", 20.0, 120.0, " deg"),
    ("seat.max_lift", 0.02 * MILLIMETRE, 3 * MILLIMETRE, " m"),
    (NOZZLE, 0.5, 1.0, ""),
    ("nozzle.hole_diameter", 0.03 * MILLIMETRE, 2 * MILLIMETRE, " m"),
    ("nozzle.sac_volume", 0.05 * CUBIC_MILLIMETRE, 1e3 * CUBIC_MILLIMETRE, " m3"),
    ("chamber.pressure", 0.0, 40e6, " Pa"),
)
_USUAL = {STIFFNESS: 1.6e9, SEAT: 0.7, NOZZLE: 0.75}
# Stiffness and coefficients apart by more, in opposite senses: a wrong inertance.
_USUAL_SPREAD = math.log(1.3)


@dataclass(frozen=True)
class ImplausibleNumber:
    """A parameter that no injector has: its name, and a sentence."""

    name: str
    words: str


def implausible(injector: InjectorParameters) -> tuple[ImplausibleNumber, ...]:
    """Implausible numbers, in the order of the file."""
    return tuple(
        ImplausibleNumber(
            name, f"{name} = {value:.6g}{unit} is beyond what injectors have, {lowest:g} to {highest:g}{unit}"
        )
        for name, lowest, highest, unit in _PLAUSIBLE
        if not lowest <= (value := _value(injector, name)) <= highest
    )


def _value(injector: InjectorParameters, name: str) -> float:
    section, _, key = name.partition(".")
    return float(getattr(getattr(injector, section), key))


def wrong_entry(injector: InjectorParameters, numbers: Sequence[ImplausibleNumber]) -> str:
    """Sentence on the entry of the file that is probably wrong, by what a fit made of it; empty if none is.

    Pressures determine flows, 1/K_L and A_L/(rho_L L_L) only up to one common factor.
    """
    names = {one.name for one in numbers}
    stiff, seat, nozzle = (math.log(_value(injector, name) / usual) for name, usual in _USUAL.items())
    passing = 0.5 * (seat + nozzle)
    if names & _USUAL.keys() and stiff * passing < 0.0 and min(abs(stiff), abs(passing)) > _USUAL_SPREAD:
        factor = 0.5 * (stiff - passing)
        how = "long, or line.diameter too small" if factor > 0.0 else "short, or line.diameter too large"
        return (
            f"stiffness and flows are off together, as if A_L/(rho_L L_L) were wrong by a factor of "
            f"{math.exp(abs(factor)):.1f}: line.length is probably too {how}"
        )
    if STIFFNESS in names:
        size = "large" if stiff > 0.0 else "small"
        return f"K_L counts only as K_L/V_L: line.volume is probably too {size}, or line.length is wrong"
    if NOZZLE in names:
        size = "small" if nozzle > 0.0 else "large"
        return f"the area of the holes is probably too {size}: nozzle.holes, nozzle.hole_diameter"
    if SEAT in names:
        size = "small" if seat > 0.0 else "large"
        return (
            f"the seat's area is probably too {size}: seat.diameter, seat.cone_angle, the factor of the lift"
        )
    return ""
