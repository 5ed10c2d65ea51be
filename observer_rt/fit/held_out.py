"""What a fit is worth on recordings it has not seen: each part left out in turn."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.phases import Phase, PhaseStatistics, no_statistics, phase_statistics
from observer_rt.evidence.bounded_fit import Quadratic, linearise
from observer_rt.evidence.likelihood import JudgedModel, Trial
from observer_rt.fit.problem import Calibration


@dataclass(frozen=True)
class UnexplainedSignal:
    """What a model leaves of a signal: mean squares by phase, 1 where it leaves noise alone; nan without samples.

    chi2: of means of 8 samples, which coloured residuals fill (of samples where a phase is shorter); variance: of
    samples; colour: the larger of means of 8 and of 20.
    """

    chi2: Mapping[Phase, float]
    variance: Mapping[Phase, float]
    colour: Mapping[Phase, float]

    @property
    def mean(self) -> float:
        """Of the chi2 of all phases."""
        return float(np.nanmean(list(self.chi2.values())))

    @property
    def worst(self) -> Phase:
        """With the largest chi2."""
        return max(self.chi2, key=lambda phase: np.nan_to_num(self.chi2[phase]))


def unexplained(statistics: PhaseStatistics) -> UnexplainedSignal:
    """In figures."""
    seen = [phase for phase in Phase if statistics.samples[phase] > 0]
    nothing = dict.fromkeys(Phase, math.nan)
    return UnexplainedSignal(
        nothing | {phase: _chi2(statistics, phase) for phase in seen},
        nothing | {phase: statistics.variance(phase) for phase in seen},
        nothing | {phase: statistics.colour(phase) for phase in seen},
    )


def _chi2(statistics: PhaseStatistics, phase: Phase) -> float:
    blocks = statistics.blocks[phase, 0]
    return float(statistics.block_squares[phase, 0] / blocks) if blocks else statistics.variance(phase)


def line_statistics(trial: Trial, one: JudgedModel) -> PhaseStatistics:
    """Of the line pressure of a part."""
    return phase_statistics(one.z, 1.0, trial.phases, 0)


def pooled(calibration: Calibration, judged: Sequence[JudgedModel]) -> UnexplainedSignal:
    """Of the line pressure of all parts together."""
    total = no_statistics()
    for trial, one in zip(calibration.trials, judged, strict=True):
        total = total.faded(1.0, line_statistics(trial, one))
    return unexplained(total)


def worst_parts(calibration: Calibration, judged: Sequence[JudgedModel]) -> UnexplainedSignal:
    """In each phase that of the part with the most left: what the model gets wrong goes with the operating point."""
    of_parts = [
        unexplained(line_statistics(trial, one))
        for trial, one in zip(calibration.trials, judged, strict=True)
    ]

    def largest(figures: Sequence[Mapping[Phase, float]]) -> dict[Phase, float]:
        return {phase: float(np.fmax.reduce([one[phase] for one in figures])) for phase in Phase}

    return UnexplainedSignal(
        largest([one.chi2 for one in of_parts]),
        largest([one.variance for one in of_parts]),
        largest([one.colour for one in of_parts]),
    )


@dataclass(frozen=True)
class HeldOut:
    """Every part judged by what the others say of the parameters.

    unexplained: of the line pressure; mass_shift: by what share the mass of its injections moves when a part is left
    out (parts,), which is how sure masses are at operating points nobody fitted.
    """

    unexplained: UnexplainedSignal
    mass_shift: NDArray[np.float64]


def held_out(calibration: Calibration, at: Quadratic) -> HeldOut | None:
    """At the minimum of all parts. None with a single part, or where the model has no solution without one.

    theta without a part is one Newton step from the minimum: it is near, and all slopes are known there.
    """
    parts = len(calibration.parts)
    if parts < 2:
        return None
    total = no_statistics()
    shifts = []
    for number in range(parts):
        theta = _without(calibration, at, number)
        one, all_in = calibration.judge(theta, number), calibration.judge(at.theta, number)
        if one is None or all_in is None:
            return None
        total = total.faded(1.0, line_statistics(calibration.trials[number], one))
        shifts.append(float(np.sum(one.masses) / np.sum(all_in.masses)) - 1.0)
    return HeldOut(unexplained(total), np.array(shifts))


def _without(calibration: Calibration, at: Quadratic, number: int) -> NDArray[np.float64]:
    """theta by all parts but one, its own offset as it is."""
    own = calibration.residuals_of(at.theta, number)
    assert own is not None  # it is part of the minimum
    part = linearise(calibration.part_alone(number), at.theta, own, calibration.ranges)
    kept = np.flatnonzero(np.arange(at.theta.size) != len(calibration.free) + number)
    information = (at.information - part.information)[np.ix_(kept, kept)]
    theta = at.theta.copy()
    theta[kept] -= np.linalg.pinv(information, hermitian=True) @ (at.gradient - part.gradient)[kept]
    lowest = np.array([r.lowest for r in calibration.ranges])
    highest = np.array([r.highest for r in calibration.ranges])
    return np.clip(theta, lowest, highest)
