"""Finds the recording that the others contradict: one of an injector that was worn, among healthy ones."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.phases import no_statistics
from observer_rt.evidence.bounded_fit import Quadratic
from observer_rt.fit.problem import Calibration
from observer_rt.fit.residuals import line_statistics, unexplained, without

LEAST_RECORDINGS = 4  # of fewer it cannot be said which one is odd
MOST_OF_IT, LESS_OF_IT = (
    0.75,
    0.5,
)  # share of what is beyond noise that goes with the odd one, and with any other


@dataclass(frozen=True)
class OddRecording:
    """recording: its number; chi2: of the others, in the worst phase, fitted with it and without it."""

    recording: int
    chi2: tuple[float, float]


def odd_recording(calibration: Calibration, at: Quadratic) -> OddRecording | None:
    """At the minimum of all recordings. None where no single one is odd.

    As in `held_out`, the minimum without a recording is taken to be one Newton step away.
    """
    numbers = sorted({part.recording for part in calibration.parts})
    if len(numbers) < LEAST_RECORDINGS:
        return None
    left = [_left_without(calibration, at, number) for number in numbers]
    found = [(before - 1.0, after - 1.0) for before, after in left]
    gone = np.array([1.0 - after / before if before > 0.0 else 0.0 for before, after in found])
    odd, next_one = (int(place) for place in np.argsort(-gone)[:2])
    if gone[odd] < MOST_OF_IT or gone[next_one] > LESS_OF_IT:
        return None
    return OddRecording(numbers[odd], left[odd])


def _left_without(calibration: Calibration, at: Quadratic, recording: int) -> tuple[float, float]:
    """chi2 in the worst phase, of all recordings, and of the others fitted without it; nan without a solution."""
    own = [number for number, part in enumerate(calibration.parts) if part.recording == recording]
    others = [number for number in range(len(calibration.parts)) if number not in own]
    everything = range(len(calibration.parts))
    return _worst(calibration, at.theta, everything), _worst(
        calibration, without(calibration, at, own), others
    )


def _worst(calibration: Calibration, theta: NDArray[np.float64], parts: Sequence[int]) -> float:
    total = no_statistics()
    for number in parts:
        judged = calibration.judge(theta, number)
        if judged is None:
            return float("nan")
        total = total.faded(1.0, line_statistics(calibration.trials[number], judged))
    found = unexplained(total)
    return found.chi2[found.worst]
