"""Clock that laws of terms may count by, and empty terms; they are evaluated once a sample by core.model."""

from typing import NamedTuple

import numpy as np

NO_PROGRAM = np.empty((0, 2))


class Clock(NamedTuple):
    """Counts for laws: time [s] and openings of the needle up to a sample."""

    time: float = 0.0
    injections: float = 0.0


NO_CLOCK = Clock()
