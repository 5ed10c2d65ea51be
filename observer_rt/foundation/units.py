"""Factors between SI (inside) and the units of screens, plots, buses and CSV files.

`value_si = value_shown * FACTOR`.
"""

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
PRESSURE_UNITS = {"Pa": 1.0, "kPa": 1e3, "MPa": MEGAPASCAL, "bar": 1e5}
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
