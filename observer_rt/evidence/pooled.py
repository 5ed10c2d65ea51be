"""What innovations of all recordings together say of a model, by signal and phase."""

from collections.abc import Mapping, Sequence
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.phases import PhaseStatistics, no_statistics, phase_statistics
from observer_rt.evidence.likelihood import Evidence, JudgedModel, Trial
from observer_rt.foundation.units import MEGAPASCAL, MM3_PER_MS


class Signal(StrEnum):
    """A signal whose innovations are judged."""

    LINE_PRESSURE = "line_pressure"
    INJECTION_RATE = "injection_rate"

    @property
    def unit(self) -> str:
        """It is printed in."""
        return "MPa" if self is Signal.LINE_PRESSURE else "mm3/ms"

    @property
    def si(self) -> float:
        """What one of that unit is in SI."""
        return MEGAPASCAL if self is Signal.LINE_PRESSURE else MM3_PER_MS

    @property
    def words(self) -> str:
        """For people."""
        return self.value.replace("_", " ")


Pool = Mapping[Signal, PhaseStatistics]
"""Statistics of each signal, pooled over recordings."""


def normalised(one: JudgedModel) -> dict[Signal, NDArray[np.float64]]:
    """Normalised residuals by signal, without the rate's gain error at the end."""
    parts = {Signal.LINE_PRESSURE: one.z}
    if one.rate_z.size:
        parts[Signal.INJECTION_RATE] = one.rate_z[:-1]
    return parts


def phases_by_signal(trial: Trial) -> dict[Signal, NDArray[np.int8]]:
    return {Signal.LINE_PRESSURE: trial.phases, Signal.INJECTION_RATE: trial.rate_phases}


def pool_of(evidence: Evidence, judged: Sequence[JudgedModel]) -> Pool:
    """Statistics of all recordings together."""
    pool: dict[Signal, PhaseStatistics] = {}
    for trial, one in zip(evidence.trials, judged, strict=True):
        for signal, z in normalised(one).items():
            found = phase_statistics(z, 1.0, phases_by_signal(trial)[signal], 0)
            pool[signal] = pool.get(signal, no_statistics()).faded(1.0, found)
    return pool
