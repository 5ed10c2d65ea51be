"""Fits one structure: coarsely for comparison, and in full if it is chosen; judged on each fold with the others' fit.

A search begins at the likeliest of many stiffnesses and dampings of the line: they decide which period of the
ringing is compared. From a stiffness 5 % wrong (at 20 kHz) a search ends beside the minimum. Where the file's needle
may be another, it begins at the likeliest of many, too: from one three times too slow it ends beside the minimum.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Floats
from observer_rt.identification.fit import forms, problem
from observer_rt.identification.fit.comparison import UnexplainedSignal, pooled
from observer_rt.identification.fit.problem import Calibration, Fold, thinned
from observer_rt.identification.likelihood.bounded_fit import Minimum, Quadratic, fit, linearise
from observer_rt.identification.likelihood.likelihood import JudgedModel
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.stability import MAX_SUBSTEPS, substeps_needed

ROUGH_EVENTS, ROUGH_ITERATIONS = 2, 8  # of an operating point, while structures are compared
FINE_EVENTS, FINE_ITERATIONS = 6, 8
MOST_FITS = 3  # of a structure, as its cells change with the sound speed found
STIFFNESSES = np.exp(np.linspace(-0.7, 0.7, 29))  # of what is known: within a factor of two, 5 % apart
STIFFNESS_SPARE = 1.2  # by which the stiffness that a search begins with may be too small
DAMPINGS = (0.5, 2.0)  # m2/s; a strong one makes the minimum wide
SACS = (1.0, 0.2, 0.04)  # of the file's
NEEDLE_DELAYS, NEEDLE_SPEEDS = (0.6, 0.8, 1.0, 1.25, 1.6), (0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0)  # of the file's
STIFFENINGS = (1.0, forms.STIFFENING.start)  # K_1 of a wave speed that hardly depends on pressure, and of fuels
CERTAIN_SIGMAS = 4.0  # standard deviations of a control flow or a displacement, below which there is none
LEAST_SIZE = 0.1  # mm3/ms, mm2: what no mass notices
EXPLAINED_CHI2 = 5.0  # mean chi2, below which a search has not ended beside the minimum


@dataclass(frozen=True)
class HeldOut:
    """Every fold judged with the parameters that the other folds give."""

    unexplained: UnexplainedSignal  # residuals of the line pressure
    mass_shift: Floats  # (folds,) change of a fold's masses, as a share, when it is left out of the fit


def held_out(calibration: Calibration, at: Quadratic) -> HeldOut | None:
    """Each fold judged a Newton step from the minimum of all; None for a single fold, or without a solution."""
    folds = len(calibration.folds)
    if folds < 2:
        return None
    left_out, shifts = [], []
    for number in range(folds):
        theta, with_needle = without(calibration, at, number)
        judged_model, all_in = calibration.judge(theta, number), calibration.judge(at.theta, number)
        moved = judged_model if np.array_equal(theta, with_needle) else calibration.judge(with_needle, number)
        if judged_model is None or all_in is None or moved is None:
            return None
        left_out.append(judged_model)
        shifts.append(float(np.sum(moved.masses) / np.sum(all_in.masses)) - 1.0)
    return HeldOut(pooled(calibration.recordings, left_out), np.array(shifts))


def without(calibration: Calibration, at: Quadratic, number: int) -> tuple[Floats, Floats]:
    """theta by all folds but one, and the same with the needle by all of them.

    The offset of this one stays, and so does the level at its pressure, which it may have measured. Structures are
    compared with their own needle; masses are not moved by one, which the observer learns from every injection anew.
    """
    own = calibration.residuals_of(at.theta, number)
    assert own is not None  # the minimum has it
    alone = linearise(partial(calibration.residuals_of, number=number), at.theta, own, calibration.ranges)
    information, gradient = at.information - alone.information, at.gradient - alone.gradient
    lowest, highest = np.array([(range_.lowest, range_.highest) for range_ in calibration.ranges]).T

    def moved(section: str) -> Floats:
        held = [k for k, one in enumerate(calibration.free) if one in forms.LEVEL or one.section == section]
        kept = np.setdiff1d(np.arange(at.theta.size), [len(calibration.free) + number, *held])
        theta = at.theta.copy()
        theta[kept] -= np.linalg.pinv(information[np.ix_(kept, kept)], hermitian=True) @ gradient[kept]
        return np.clip(theta, lowest, highest)

    return moved(""), moved("needle")


@dataclass(frozen=True, eq=False)
class FittedStructure:
    """A structure at its minimum."""

    structure: forms.Structure
    calibration: problem.Calibration
    minimum: Minimum
    judged: Sequence[JudgedModel]  # every fold
    unexplained: UnexplainedSignal  # residuals of the line pressure on the recordings of the fit
    held_out: HeldOut | None  # on recordings left out; None: none could be

    @property
    def injector(self) -> InjectorParameters:
        """The injector fitted."""
        return self.calibration.injector(self.minimum.at.theta)

    @property
    def offsets(self) -> Floats:
        """Offsets of the line-pressure sensor in each fold [MPa]."""
        return self.minimum.at.theta[len(self.calibration.free) :]

    @property
    def mass(self) -> float:
        """Mass of all injections [kg]."""
        return float(sum(fold.masses.sum() for fold in self.judged))

    @property
    def certainty(self) -> problem.Certainty:
        """Certainty of the parameters, reduced where residuals are more than noise."""
        return problem.certainty(self.calibration, self.minimum.at, max(1.0, self.unexplained.mean))


@dataclass(frozen=True)
class FailedStructure:
    """A structure that could not be fitted, with the reason."""

    structure: forms.Structure
    reason: str


def fitted(
    structure: forms.Structure,
    start: InjectorParameters,
    free: Sequence[forms.FreeParameter],
    folds: Sequence[Fold],
    iterations: int,
    spare: float = 1.0,
) -> FittedStructure | FailedStructure:
    """A structure fitted from the numbers of `start`, and again if its cells do not suit the sound speed found."""
    injector = structure.of(start, spare)
    needed = substeps_needed(injector, folds[0].measurement.recording.sample_rate)
    if needed > MAX_SUBSTEPS:
        reason = f"would need {needed} steps a sample, for its sac is small (at most {MAX_SUBSTEPS})"
        return FailedStructure(structure, reason)
    try:
        calibration, minimum = _fit(injector, free, folds, iterations)
        for _ in range(MOST_FITS - 1):
            again = injector if minimum is None else structure.of(calibration.injector(minimum.at.theta))
            if again.line.cells == injector.line.cells:
                break
            injector = again
            calibration, minimum = _fit(injector, free, folds, iterations)
    except UserError as error:
        return FailedStructure(structure, error.problem)
    judged = None if minimum is None else calibration.judge_all(minimum.at.theta)
    if minimum is None or judged is None:
        reason = "has no finite solution on these recordings from the numbers it was started with"
        return FailedStructure(structure, reason)
    unexplained = pooled(calibration.recordings, judged)
    return FittedStructure(structure, calibration, minimum, judged, unexplained, held_out(calibration, minimum.at))


def _fit(
    start: InjectorParameters, free: Sequence[forms.FreeParameter], folds: Sequence[Fold], iterations: int
) -> tuple[problem.Calibration, Minimum | None]:
    calibration = problem.Calibration(start, free, folds)
    return calibration, fit(calibration.residuals, calibration.centre, calibration.ranges, iterations)


def settled(
    best: FittedStructure, start: InjectorParameters, folds: Sequence[Fold]
) -> tuple[FittedStructure, tuple[forms.FreeParameter, ...]]:
    """The structure fitted to `folds`, and undetermined parameters left to the file, the least certain first."""
    left_out: list[forms.FreeParameter] = []
    free, now = list(best.calibration.free), best
    while True:
        numbers = forms.with_values(now.injector, left_out, forms.values_of(best.structure.of(start), left_out))
        again = fitted(best.structure, numbers, free, folds, FINE_ITERATIONS)
        if isinstance(again, FailedStructure):
            return now, tuple(left_out)
        now = again
        groups = [group for group in forms.OPTIONAL_GROUPS if group[0] in free and group not in certain_groups(now)]
        if groups:
            doubtful = [one for group in groups for one in group if one in free]
            left_out += doubtful
            free = [one for one in free if one not in doubtful]
            continue
        undetermined = now.certainty.undetermined
        if undetermined is None or len(free) == 1:
            return now, tuple(left_out)
        left_out.append(undetermined)
        free.remove(undetermined)


def searched(
    structure: forms.Structure, file: InjectorParameters, free: Sequence[forms.FreeParameter], folds: Sequence[Fold]
) -> FittedStructure | FailedStructure:
    """A structure fitted coarsely from the file's numbers, with waves after a scan of stiffness and damping.

    Where the file's needle may be another, from the likeliest of many; where much is left, again from other lines.
    """
    few = tuple(thinned(fold, 1) for fold in folds)
    file = _with_likely_needle(structure, file, free, few) if forms.USUAL_SEAT in free else file
    if forms.WAVE_DAMPING not in structure.free:
        return fitted(structure, file, free, folds, ROUGH_ITERATIONS)
    start = _best(structure, _around(file, free), free, few)
    rough = fitted(structure, start, free, folds, ROUGH_ITERATIONS, STIFFNESS_SPARE)
    if isinstance(rough, FailedStructure) or rough.unexplained.mean < EXPLAINED_CHI2:
        return rough
    here = rough.injector
    again = _best(structure, [here, *_around(here, free)], free, few)
    if again is here:
        return rough
    other = fitted(structure, again, free, folds, ROUGH_ITERATIONS, STIFFNESS_SPARE)
    is_better = isinstance(other, FittedStructure) and other.minimum.statistic < rough.minimum.statistic
    return other if is_better else rough


def certain_groups(structure: FittedStructure) -> tuple[tuple[forms.FreeParameter, ...], ...]:
    """Groups of `OPTIONAL_GROUPS` whose first parameter is certain, or stated in the file."""
    free, sigmas, groups = structure.calibration.free, structure.certainty.sigmas, []
    for group in forms.OPTIONAL_GROUPS:
        size, sigma = group[0].of(structure.injector), 0.0
        if group[0] in free:
            sigma = max(CERTAIN_SIGMAS * float(sigmas[free.index(group[0])]), LEAST_SIZE) * group[0].linear
        if abs(size) > sigma:
            groups.append(group)
    return tuple(groups)


def _around(injector: InjectorParameters, free: Sequence[forms.FreeParameter]) -> list[InjectorParameters]:
    fuels = [np.array([])] if forms.STIFFENING not in free else [np.array([each]) for each in STIFFENINGS]
    sized = (forms.STIFFNESS, forms.WAVE_DAMPING, *(one for one in free if one is forms.STIFFENING))
    return [
        forms.with_values(injector, sized, np.array([stiffness, damping, *fuel]))
        for stiffness in forms.STIFFNESS.of(injector) * STIFFNESSES
        for damping in DAMPINGS
        for fuel in fuels
    ]


def _best(
    structure: forms.Structure,
    starts: Sequence[InjectorParameters],
    free: Sequence[forms.FreeParameter],
    folds: Sequence[Fold],
) -> InjectorParameters:
    return min(starts, key=lambda start: _statistic(problem.Calibration(structure.of(start), free, folds)))


def _with_likely_needle(
    structure: forms.Structure, file: InjectorParameters, free: Sequence[forms.FreeParameter], folds: Sequence[Fold]
) -> InjectorParameters:
    """An injector with the likeliest of many sacs, delays and speeds of its needle: of opening, then of closing."""
    calibration = problem.Calibration(structure.of(file), free, folds)
    theta, sacs = calibration.centre, SACS if forms.WAVE_DAMPING in free else SACS[:1]
    for moved, sizes in ((forms.FLOW_STARTS[:3], [sacs]), (forms.FLOW_STARTS[3:], [])):
        moves = np.log(list(itertools.product(*sizes, NEEDLE_DELAYS, NEEDLE_SPEEDS)))
        starts = np.tile(theta, (len(moves), 1))
        starts[:, [free.index(one) for one in moved]] += moves
        theta = min((theta, *starts), key=partial(_statistic, calibration))
    likely = calibration.injector(theta)
    return forms.with_values(file, forms.FLOW_STARTS, forms.values_of(likely, forms.FLOW_STARTS))


def _statistic(calibration: problem.Calibration, theta: Floats | None = None) -> float:
    residuals = calibration.residuals(calibration.centre if theta is None else theta)
    return math.inf if residuals is None or math.isnan(residuals.statistic) else residuals.statistic
