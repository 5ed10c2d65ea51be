"""Units of an injection rate in measurement files."""

from observer_rt.foundation.units import CUBIC_MILLIMETRE, MM3_PER_MS

RATE_UNITS = {
    "m3/s": 1.0,
    "mm3/ms": MM3_PER_MS,
    "mm3/s": CUBIC_MILLIMETRE,
    "m³/s": 1.0,
    "mm³/ms": MM3_PER_MS,
    "mm³/s": CUBIC_MILLIMETRE,
}
