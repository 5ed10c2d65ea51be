"""Factors between SI (inside) and units of screens, plots, buses, CSV files; numbers and lists as people write them.

`value_si = value_shown * FACTOR`.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]  # values in such a unit
Ints = NDArray[np.int64]  # places, counts, stamps
Bools = NDArray[np.bool_]  # whether, of each
Structs = NDArray[np.void]  # of the core, whose fields have names
MEGAPASCAL = 1e6  # Pa
MILLIMETRE = 1e-3  # m
MICROMETRE = 1e-6  # m
MILLISECOND = 1e-3  # s
MICROSECOND = 1e-6  # s
NANOSECOND = 1e-9  # s
NANOSECONDS = 1_000_000_000  # in a second: whole, as stamps are
NANOSECONDS_PER_MS = 1_000_000
NANOSECONDS_PER_US = 1_000
MM3_PER_MS = 1e-6  # m3/s
CUBIC_MILLIMETRE = 1e-9  # m3
MILLIGRAM = 1e-6  # kg
ZERO_CELSIUS = 273.15  # K
Z_95 = 1.96  # standard deviations from the mean to either end of a 95 % interval

# Units a bus database or a measurement file may state, by quantity: value_si = value * factor.
PRESSURE_UNITS = {"Pa": 1.0, "hPa": 1e2, "kPa": 1e3, "MPa": 1e6, "mbar": 1e2, "bar": 1e5, "psi": 6894.757293168}
LENGTH_UNITS = {"m": 1.0, "mm": MILLIMETRE, "um": MICROMETRE, "µm": MICROMETRE, "μm": MICROMETRE}
MASS_UNITS = {"kg": 1.0, "g": 1e-3, "mg": MILLIGRAM, "mg/stroke": MILLIGRAM}
TIME_UNITS = {"s": 1.0, "ms": MILLISECOND, "us": MICROSECOND, "µs": MICROSECOND, "μs": MICROSECOND, "ns": NANOSECOND}

# value_si = value + origin; all have kelvins as steps
TEMPERATURE_ORIGINS = {"K": 0.0, "degC": ZERO_CELSIUS, "deg C": ZERO_CELSIUS, "°C": ZERO_CELSIUS, "C": ZERO_CELSIUS}

_SPELLINGS = {  # in small letters, of units above
    "sec": "s",
    "second": "s",
    "seconds": "s",
    "msec": "ms",
    "usec": "us",
    "µsec": "us",
    "micron": "um",
    "microns": "um",
    "mikrometer": "um",
    "bara": "bar",
    "n/mm2": "MPa",
}
_POWERS = str.maketrans("²³", "23", "^")

_SIGNS = {"um": "µm", "us": "µs", "mm3/ms": "mm³/ms", "m3/(s Pa)": "m³/(s Pa)", "-": ""}
"""Units as people write them, by those of files."""


def spelled(unit: str, units: Mapping[str, float]) -> str:
    """Spelling of a unit in `units`, found whatever its case and spelling; empty if `units` lack it."""
    if unit in units:
        return unit
    small = unit.strip().lower().translate(_POWERS).replace("_per_", "/")
    spelling = _SPELLINGS.get(small, small)
    return next((each for each in units if spelling in (each, each.lower())), "")


def factor_of(text: str, units: Mapping[str, float]) -> float | None:
    """Factor of a unit to SI, by its name or as a number of them, such as `0.05 MPa`; None if it is neither."""
    number, _, name = text.strip().rpartition(" ")
    try:
        count = float(number) if number else 1.0
    except ValueError:
        return None
    unit = spelled(name, units)
    return count * units[unit] if math.isfinite(count) and count != 0.0 and unit else None


def sign(unit: str) -> str:
    """A unit as people write it."""
    return _SIGNS.get(unit, unit)


def significant(uncertainty: float) -> float:
    """The unit of the second digit of an uncertainty: what a value is rounded to."""
    return 10.0 ** (int(f"{uncertainty:.0e}".split("e")[1]) - 1) if uncertainty > 0.0 else 0.0


def shown(value: float, step: float) -> str:
    """A value rounded to a step of 10^n; as short as it may be."""
    if not step > 0.0:
        return f"{value:.6g}"
    decimals = -int(f"{step:.0e}".split("e")[1])
    if -3 <= decimals <= 6:
        return f"{round(value, decimals):.{max(decimals, 0)}f}"
    digits = 1 + max(0, int(f"{abs(value) or step:.0e}".split("e")[1]) + decimals)
    return f"{value:.{digits}g}"


def first_of(words: Sequence[str], most: int = 5, between: str = ", ") -> str:
    """The first of many words, and how many more there are."""
    more = f" and {len(words) - most} more" if len(words) > most else ""
    return between.join(words[:most]) + more
