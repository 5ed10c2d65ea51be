"""Findings about an injector's parameters: whether a common-rail injector can be like that."""

from observer_rt.check.findings import Finding, Level
from observer_rt.foundation.units import CUBIC_MILLIMETRE, MILLIMETRE
from observer_rt.model.parameters import InjectorParameters

_TOPIC = "injector"

# Generous bounds, from small car injectors to those of large ships: what lies beyond is most often a value in
# other units than SI. Section, key, lowest, highest, unit.
_PLAUSIBLE = (
    ("fluid", "density_line", 600.0, 1_100.0, "kg/m3"),
    ("fluid", "density_nozzle", 600.0, 1_100.0, "kg/m3"),
    ("fluid", "bulk_modulus_line", 0.5e9, 5e9, "Pa"),
    ("fluid", "bulk_modulus_sac", 0.5e9, 5e9, "Pa"),
    ("fluid", "vapour_pressure", 0.0, 1e6, "Pa"),
    ("line", "length", 10 * MILLIMETRE, 5.0, "m"),
    ("line", "diameter", 0.5 * MILLIMETRE, 30 * MILLIMETRE, "m"),
    ("line", "volume", 10 * CUBIC_MILLIMETRE, 1e6 * CUBIC_MILLIMETRE, "m3"),
    ("line", "loss_factor", 0.0, 1e3, "-"),
    ("seat", "flow_coefficient", 0.1, 1.0, "-"),
    ("seat", "diameter", 0.5 * MILLIMETRE, 20 * MILLIMETRE, "m"),
    ("seat", "cone_angle", 20.0, 120.0, "deg"),
    ("seat", "max_lift", 0.02 * MILLIMETRE, 3 * MILLIMETRE, "m"),
    ("nozzle", "flow_coefficient", 0.1, 1.0, "-"),
    ("nozzle", "hole_diameter", 0.03 * MILLIMETRE, 2 * MILLIMETRE, "m"),
    ("nozzle", "sac_volume", 0.05 * CUBIC_MILLIMETRE, 1e3 * CUBIC_MILLIMETRE, "m3"),
    ("chamber", "pressure", 0.0, 40e6, "Pa"),
)


def plausibility_findings(injector: InjectorParameters) -> list[Finding]:
    """A warning for every parameter that no injector has, or one finding that all can be."""
    findings = []
    for section, key, lowest, highest, unit in _PLAUSIBLE:
        value = getattr(getattr(injector, section), key)
        if not lowest <= value <= highest:
            findings.append(
                Finding(
                    _TOPIC,
                    Level.WARNING,
                    f"{section}.{key} = {value:g} {unit} is beyond what injectors have, {lowest:g} to {highest:g} "
                    f"{unit}; is it in SI units?",
                )
            )
    return findings or [Finding(_TOPIC, Level.OK, "every parameter is one an injector can have")]
