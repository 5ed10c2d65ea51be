"""Factors between SI (inside) and the units of screens, plots, buses and CSV files.

`value_si = value_shown * FACTOR`.
"""

import math
from collections.abc import Mapping

MEGAPASCAL = 1e6  # Pa
MILLIMETRE = 1e-3  # m
MICROMETRE = 1e-6  # m
MILLISECOND = 1e-3  # s
MICROSECOND = 1e-6  # s
MM3_PER_MS = 1e-6  # m3/s
CUBIC_MILLIMETRE = 1e-9  # m3
MILLIGRAM = 1e-6  # kg
ZERO_CELSIUS = 273.15  # K

# Units a bus database or a measurement file may state, by quantity: value_si = value * factor.
PRESSURE_UNITS = {
    "Pa": 1.0,
    "hPa": 1e2,
    "kPa": 1e3,
    "MPa": MEGAPASCAL,
    "mbar": 1e2,
    "bar": 1e5,
    "psi": 6894.757293168,
}
LENGTH_UNITS = {"m": 1.0, "mm": MILLIMETRE, "um": MICROMETRE, "µm": MICROMETRE, "μm": MICROMETRE}
MASS_UNITS = {"kg": 1.0, "g": 1e-3, "mg": MILLIGRAM, "mg/stroke": MILLIGRAM}
TIME_UNITS = {"s": 1.0, "ms": MILLISECOND, "us": MICROSECOND, "µs": MICROSECOND, "μs": MICROSECOND}

# value_si = value + origin; all have kelvins as steps
TEMPERATURE_ORIGINS = {
    "K": 0.0,
    "degC": ZERO_CELSIUS,
    "deg C": ZERO_CELSIUS,
    "°C": ZERO_CELSIUS,
    "C": ZERO_CELSIUS,
}


def factor_of(text: str, units: Mapping[str, float]) -> float | None:
    """Factor of a unit to SI, by its name or as a number of them, such as `0.05 MPa`; None if it is neither."""
    number, _, name = text.strip().rpartition(" ")
    try:
        count = float(number) if number else 1.0
    except ValueError:
        return None
    known = math.isfinite(count) and count != 0.0 and name in units
    return count * units[name] if known else None
