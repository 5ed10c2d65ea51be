"""Judges every fold with the parameters that the other folds give."""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from observer_rt.identification.fit.comparison import UnexplainedSignal, pooled
from observer_rt.identification.fit.forms import INERTANCE
from observer_rt.identification.fit.problem import Calibration
from observer_rt.identification.likelihood.bounded_fit import Quadratic, linearise


@dataclass(frozen=True)
class HeldOut:
    """Every fold judged with the parameters that the other folds give."""

    unexplained: UnexplainedSignal  # residuals of the line pressure
    mass_shift: NDArray[np.float64]  # (folds,) change of a fold's masses, as a share, when it is left out of the fit


def held_out(calibration: Calibration, at: Quadratic) -> HeldOut | None:
    """Each fold judged a Newton step from the minimum of all; None for a single fold, or without a solution."""
    folds = len(calibration.folds)
    if folds < 2:
        return None
    left_out, shifts = [], []
    for number in range(folds):
        theta = without(calibration, at, number)
        judged_model, all_in = calibration.judge(theta, number), calibration.judge(at.theta, number)
        if judged_model is None or all_in is None:
            return None
        left_out.append(judged_model)
        shifts.append(float(np.sum(judged_model.masses) / np.sum(all_in.masses)) - 1.0)
    return HeldOut(pooled(calibration.recordings, left_out), np.array(shifts))


def without(calibration: Calibration, at: Quadratic, number: int) -> NDArray[np.float64]:
    """theta by all folds but one. The offset of this one stays, and so does the level, which it may have measured."""
    own = calibration.residuals_of(at.theta, number)
    assert own is not None  # the minimum has it
    alone = linearise(partial(calibration.residuals_of, number=number), at.theta, own, calibration.ranges)
    information, gradient = at.information - alone.information, at.gradient - alone.gradient
    held = [len(calibration.free) + number]
    held += [place for place, one in enumerate(calibration.free) if one is INERTANCE]
    kept = np.setdiff1d(np.arange(at.theta.size), held)
    theta = at.theta.copy()
    theta[kept] -= np.linalg.pinv(information[np.ix_(kept, kept)], hermitian=True) @ gradient[kept]
    lowest, highest = np.array([(range_.lowest, range_.highest) for range_ in calibration.ranges]).T
    return np.clip(theta, lowest, highest)
