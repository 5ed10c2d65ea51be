"""What sensors and the bus make of a signal: white noise, then 16-bit quantisation."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

HIGHEST_CODE = 0xFFFD  # above it the bus says "error" and "not available"


class Quantisation(NamedTuple):
    """16-bit codes of the bus: value = (code + lowest) * multiple / divisor, exact in SI units."""

    lowest: int
    multiple: float
    divisor: float

    def apply(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Nearest values the bus can carry, clipped to its range; shape (n,)."""
        steps = np.rint(values * (self.divisor / self.multiple))
        return np.clip(steps, self.lowest, self.lowest + HIGHEST_CODE) * self.multiple / self.divisor


PRESSURE = Quantisation(lowest=-2000, multiple=5000.0, divisor=1.0)
"""0.005 MPa steps from -10 MPa."""
LIFT = Quantisation(lowest=-5000, multiple=1.0, divisor=1e8)
"""0.01 um steps from -50 um."""


@dataclass(frozen=True)
class SimulatedNoise:
    """Standard deviations of white noise per sample, whatever the sample rate."""

    rail_pressure: float = 0.1e6
    """[Pa]"""
    needle_lift: float = 0.4e-6
    """[m]"""
    line_pressure: float = 0.15e6
    """[Pa]"""
    injection_rate: float = 0.5e-6
    """[m3/s]"""
    injection_rate_gain: float = 0.005
    """Of the measured rate's gain, once a recording [-]."""
