"""How the fuel changes with its temperature: density and bulk moduli of the injector file, at another temperature.

Both fall linearly, as measured of diesel fuels and calibration oils within a few tens of kelvin:

    rho(T) = rho (1 - alpha (T - T_0))      K(T) = K + s (T - T_0),  s < 0

`thermal_expansion` alpha and `bulk_modulus_slope` s hold for line and nozzle (sac) alike; T_0 is the temperature the
file's values were taken at. Areas, volumes and the vapour pressure stay.
"""

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import ZERO_CELSIUS
from observer_rt.model.parameters import InjectorParameters

LOWEST_TEMPERATURE = 233.15  # K, -40 degC: below it the fuel waxes
HIGHEST_TEMPERATURE = 423.15  # K, 150 degC: above it no feed line is run
SMALLEST_FACTOR = 0.3  # of density or bulk modulus: beyond it the law no longer describes a fuel


def is_plausible(temperature: float) -> bool:
    """Whether fuel [K] can be so warm; not a number is not."""
    return LOWEST_TEMPERATURE <= temperature <= HIGHEST_TEMPERATURE


def temperature_of(place: str, celsius: float) -> float:
    """A temperature the user gave in degC [K]. Raises `UserError` naming `place` where no fuel can be so warm."""
    temperature = celsius + ZERO_CELSIUS
    if not is_plausible(temperature):
        lowest, highest = LOWEST_TEMPERATURE - ZERO_CELSIUS, HIGHEST_TEMPERATURE - ZERO_CELSIUS
        raise UserError(
            place, f"{celsius:g} degC is no temperature of a fuel", f"give {lowest:.0f} to {highest:.0f} degC"
        )
    return temperature


def at_temperature(injector: InjectorParameters, temperature: float) -> InjectorParameters:
    """The injector with its fuel at a temperature [K], which is its reference temperature then.

    Raises `UserError` when it has no reference temperature, or the law would leave no fuel.
    """
    fluid = injector.fluid
    if fluid.reference_temperature is None:
        raise UserError(
            "fluid.reference_temperature",
            "is missing, so that nothing tells at which temperature the densities and bulk moduli hold",
            "add the temperature of the fuel they were taken at, in K, such as 313.15",
        )
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
