"""Plausible ranges of an injector's numbers, and the entries to check if a fitted number lies beyond its range.

Ranges of geometry are generous, for values beyond them are mostly in other units. Fitted numbers have physical
ranges, for a fit hides wrong geometry in them. Bulk modulus by speed of sound: diesel some 1.2 to 2.8 GPa from 15 to
180 MPa and 298 to 343 K (Payri et al., Fuel 90, 2011), petrol .7 GPa at least, as warm n-hexane, one of its light
parts (Khasanshin et al., J. Eng. Phys. Thermophys. 81, 2008). Flow coefficients of holes: from .61 at a sharp edge
(Kirchhoff: pi/(pi + 2)) to .9 of rounded, conical ones; a seat's is lower if the lift reads too large.
"""

from dataclasses import dataclass

from observer_rt.foundation.units import CUBIC_MILLIMETRE, MILLIMETRE
from observer_rt.model.parameters import InjectorParameters

STIFFNESS = "fluid.bulk_modulus_line"
SEAT, NOZZLE = "seat.flow_coefficient", "nozzle.flow_coefficient"
_PLAUSIBLE = (  # lowest, highest, unit as it is printed
    ("fluid.density_line", 600.0, 1_100.0, " kg/m3"),
    ("fluid.density_nozzle", 600.0, 1_100.0, " kg/m3"),
    (STIFFNESS, 0.7e9, 3e9, " Pa"),
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
_MADE_UP_FOR = {
    STIFFNESS: "line.volume (K_L counts only as K_L/V_L), line.length or line.diameter",
    SEAT: "seat.diameter, seat.cone_angle, the factor of the lift, or line.length",
    NOZZLE: "nozzle.holes, nozzle.hole_diameter or line.length",
}
"""Entries of the file that a fit makes up for by a number."""


@dataclass(frozen=True)
class ImplausibleNumber:
    """A parameter with a value that no injector has: its name, a sentence, and entries that explain it in a fit."""

    name: str
    words: str
    made_up_for: str


def implausible(injector: InjectorParameters) -> tuple[ImplausibleNumber, ...]:
    """Implausible numbers, in the order of the file."""
    result = []
    for name, lowest, highest, unit in _PLAUSIBLE:
        section, _, key = name.partition(".")
        value = float(getattr(getattr(injector, section), key))
        if not lowest <= value <= highest:
            limits = f"{lowest:g} to {highest:g}{unit}"
            words = f"{name} = {value:.6g}{unit} is beyond what injectors have, {limits}"
            result.append(ImplausibleNumber(name, words, _MADE_UP_FOR.get(name, "")))
    return tuple(result)
