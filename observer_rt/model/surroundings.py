"""Surroundings of an injector, optional inputs of a bench, which change its parameters: fuel temperature, chamber.

Densities and bulk moduli fall linearly with the temperature, as measured for diesel fuels and calibration oils within
a few tens of kelvin:

    rho(T) = rho (1 - alpha (T - T_0))      K(T) = K + s (T - T_0),  s < 0

`thermal_expansion` alpha and `bulk_modulus_slope` s hold for line and nozzle (sac) alike; T_0 is the temperature the
file values were taken at. Areas, volumes and the vapour pressure stay. The pressure in the chamber is p_C, from which
all pressures of the model count (24).
"""

from collections.abc import Iterable
from typing import NamedTuple

from observer_rt.foundation.errors import UserError
from observer_rt.model.parameters import Chamber, InjectorParameters

TEMPERATURES = 233.15, 423.15  # K, -40 to 150 degC: below the fuel waxes, above no feed line is run
CHAMBER_PRESSURES = 0.01e6, 40e6  # Pa: a sensor that is not connected shows less, no chamber is under more
SMALLEST_FACTOR = 0.3  # of density or bulk modulus: beyond it the law no longer describes a fuel


class Surroundings(NamedTuple):
    """Quantities round the injector [SI], by the names of their optional roles; None: not measured, as filed."""

    fuel_temperature: float | None = None  # in the feed line, K
    chamber_pressure: float | None = None  # p_C, absolute, Pa


def filed(injector: InjectorParameters, names: Iterable[str]) -> Surroundings:
    """Surroundings at which an injector's parameters hold, those with these names; the others None."""
    values = {"fuel_temperature": injector.fluid.reference_temperature, "chamber_pressure": injector.chamber.pressure}
    return Surroundings(**{name: values[name] for name in names})


def in_surroundings(injector: InjectorParameters, surroundings: Surroundings) -> InjectorParameters:
    """The injector with the parameters that it has in surroundings. Raises `UserError` as `at_temperature`."""
    if surroundings.fuel_temperature is not None:
        injector = at_temperature(injector, surroundings.fuel_temperature)
    if surroundings.chamber_pressure is not None:
        injector = injector.model_copy(update={"chamber": Chamber(pressure=surroundings.chamber_pressure)})
    return injector


def at_temperature(injector: InjectorParameters, temperature: float) -> InjectorParameters:
    """The injector with its fuel at another temperature [K]. Raises `UserError`: no reference, or no law there."""
    fluid = injector.fluid
    if fluid.reference_temperature is None:
        problem = "is missing, so that nothing says at which temperature the densities and bulk moduli hold"
        remedy = "add the temperature of the fuel they were taken at, in K, such as 313.15"
        raise UserError("fluid.reference_temperature", problem, remedy)
    warmer = temperature - fluid.reference_temperature
    expanded = 1.0 - fluid.thermal_expansion * warmer
    softened = fluid.bulk_modulus_slope * warmer
    changed = {
        "density_line": fluid.density_line * expanded,
        "density_nozzle": fluid.density_nozzle * expanded,
        "bulk_modulus_line": fluid.bulk_modulus_line + softened,
        "bulk_modulus_sac": fluid.bulk_modulus_sac + softened,
    }
    for key, value in changed.items():
        if value < SMALLEST_FACTOR * getattr(fluid, key):
            cause = "thermal_expansion" if key.startswith("density") else "bulk_modulus_slope"
            raise UserError(
                f"fluid.{cause}",
                f"makes {key} {value:.3g} at {temperature:.0f} K, of {getattr(fluid, key):.3g} at "
                f"{fluid.reference_temperature:.0f} K",
                "correct it: diesel fuels have about 7e-4 1/K and -7e6 Pa/K",
            )
    changed["reference_temperature"] = temperature
    return injector.model_copy(update={"fluid": fluid.model_copy(update=changed)})
