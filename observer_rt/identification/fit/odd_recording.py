"""Finds the recording that the others contradict: one of an injector that was worn, among healthy ones."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.identification.fit.problem import Calibration
from observer_rt.identification.fit.residuals import pooled, without
from observer_rt.identification.likelihood.bounded_fit import Quadratic

LEAST_RECORDINGS = 4  # among fewer none can be named as the odd one
MOST_OF_IT, LESS_OF_IT = 0.75, 0.5  # share of what is beyond noise that goes with it, and with any other


@dataclass(frozen=True)
class OddRecording:
    """recording: its number; chi2: of the others, in the worst phase, fitted with it and without it."""

    recording: int
    chi2: tuple[float, float]


def odd_recording(calibration: Calibration, at: Quadratic) -> OddRecording | None:
    """At the minimum of all recordings. None where no single one is odd.

    As in `held_out`, the minimum without a recording is taken to be one Newton step away.
    """
    numbers = sorted({fold.recording for fold in calibration.folds})
    if len(numbers) < LEAST_RECORDINGS:
        return None
    before = _worst(calibration, at.theta, range(len(calibration.folds)))
    if not before > 1.0:
        return None
    after = [_left_without(calibration, at, number) for number in numbers]
    gone = 1.0 - (np.array(after) - 1.0) / (before - 1.0)
    odd, next_one = (int(place) for place in np.argsort(-gone)[:2])
    if gone[odd] < MOST_OF_IT or gone[next_one] > LESS_OF_IT:
        return None
    return OddRecording(numbers[odd], (before, after[odd]))


def _left_without(calibration: Calibration, at: Quadratic, recording: int) -> float:
    """chi2 in the worst phase of the other recordings, fitted without this one."""
    numbers = range(len(calibration.folds))
    own = [number for number in numbers if calibration.folds[number].recording == recording]
    return _worst(calibration, without(calibration, at, own), [one for one in numbers if one not in own])


def _worst(calibration: Calibration, theta: NDArray[np.float64], folds: Sequence[int]) -> float:
    """chi2 of folds in the worst phase; nan without a solution."""
    judged = [one for number in folds if (one := calibration.judge(theta, number)) is not None]
    if len(judged) < len(folds):
        return math.nan
    left = pooled([calibration.recordings[number] for number in folds], judged)
    return left.chi2[left.worst]
