"""The two signals that models are judged by, and statistics of their normalised residuals by phase."""

from collections.abc import Mapping, Sequence
from enum import StrEnum

from observer_rt.engine.estimation.phases import PhaseStatistics, no_statistics, phase_statistics
from observer_rt.foundation.units import MEGAPASCAL, MM3_PER_MS
from observer_rt.identification.likelihood.likelihood import JudgedModel, RecordingLikelihood


class Signal(StrEnum):
    """A signal whose innovations are judged."""

    LINE_PRESSURE = "line_pressure"
    INJECTION_RATE = "injection_rate"

    @property
    def unit(self) -> str:
        """Unit in which its values are printed."""
        return "MPa" if self is Signal.LINE_PRESSURE else "mm3/ms"

    @property
    def si(self) -> float:
        """Factor from the printed unit to SI."""
        return MEGAPASCAL if self is Signal.LINE_PRESSURE else MM3_PER_MS

    @property
    def words(self) -> str:
        """Name of the signal for people."""
        return self.value.replace("_", " ")


Pool = Mapping[Signal, PhaseStatistics]  # of the normalised residuals of each signal


def statistics_by_signal(recorded: RecordingLikelihood, judged: JudgedModel) -> Pool:
    """Statistics of a model on one recording; the estimated gain error of a measured rate does not count."""
    pool = {Signal.LINE_PRESSURE: phase_statistics(judged.z, 1.0, recorded.phases, 0)}
    if judged.rate_z.size:
        pool[Signal.INJECTION_RATE] = phase_statistics(judged.z_of_rate, 1.0, recorded.rate_phases, 0)
    return pool


def pool_of(recordings: Sequence[RecordingLikelihood], judged: Sequence[JudgedModel]) -> Pool:
    """Statistics of a model on all recordings together."""
    pool: dict[Signal, PhaseStatistics] = {}
    for recorded, judged_model in zip(recordings, judged, strict=True):
        for signal, statistics in statistics_by_signal(recorded, judged_model).items():
            pool[signal] = pool.get(signal, no_statistics()).faded(1.0, statistics)
    return pool
