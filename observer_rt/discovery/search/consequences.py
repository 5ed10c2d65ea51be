"""What a change of the model does to line pressure and mass: a large gap in pressure need not be one in mass."""

from collections.abc import Sequence

import numpy as np

from observer_rt.discovery.search.result import Consequence
from observer_rt.evidence.measurement import Measurement
from observer_rt.evidence.open_loop import mass, simulated
from observer_rt.model.effective import EffectiveModel


def consequence(
    measured: Sequence[Measurement], before: EffectiveModel, after: EffectiveModel
) -> Consequence:
    """By how much line pressure and mass move from one model to another."""
    pressures, masses = [], []
    for measurement in measured:
        for old, new in zip(simulated(measurement, before), simulated(measurement, after), strict=True):
            pressures.append(new.line_pressure - old.line_pressure)
            masses.append(
                mass(measurement, new, after.coefficients.density)
                - mass(measurement, old, before.coefficients.density)
            )
    squares = np.concatenate(pressures) ** 2
    return Consequence(float(np.sqrt(np.mean(squares))), float(np.mean(masses)))
