"""Two explanations of the same recordings, each at its best, by the oracle. Imports nothing of `observer_rt`."""

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from tools.benchmarks.discovery.hidden import HIDDEN, HiddenEffect
from tools.benchmarks.discovery.oracle import Recorded, residuals, statistic

STARTS = 6  # of either sign, from below detection to large
WIDER = 1.5  # than what is drawn, a rival may be
REFINED = 2  # of the starts
SHAPE_STARTS = 2  # of a further parameter


def best_statistic(recordings: Sequence[Recorded], effect_id: str) -> float:
    """Smallest -2 log L of a model with this effect, its parameters free."""
    effect = HIDDEN[effect_id]
    if not effect.parameters:
        return statistic(recordings, effect.faults(()))
    starts = sorted(_starts(effect), key=lambda values: statistic(recordings, effect.faults(values)))
    return min(_refined(recordings, effect, start) for start in starts[:REFINED])


def _starts(effect: HiddenEffect) -> list[tuple[float, ...]]:
    size, *shapes = effect.parameters
    sizes = list(np.geomspace(size.lowest, size.highest, STARTS))
    if size.most_negative < 0.0:
        sizes += [-value for value in np.geomspace(size.lowest, -size.most_negative, STARTS)]
    return list(product(sizes, *(np.geomspace(p.lowest, p.highest, SHAPE_STARTS) for p in shapes)))


def _refined(recordings: Sequence[Recorded], effect: HiddenEffect, start: tuple[float, ...]) -> float:
    scale = np.array([math.sqrt(p.lowest * p.highest) for p in effect.parameters])
    lowest = [WIDER * p.most_negative if p is effect.parameters[0] else p.lowest for p in effect.parameters]
    highest = [WIDER * p.highest for p in effect.parameters]

    def values_at(x: NDArray[np.float64]) -> tuple[float, ...]:
        return tuple(float(value) for value in x * scale)

    found = least_squares(
        lambda x: residuals(recordings, effect.faults(values_at(x))),
        np.clip(np.array(start), lowest, highest) / scale,
        bounds=(np.array(lowest) / scale - 1e-12, np.array(highest) / scale),
        diff_step=1e-4,
        xtol=1e-6,
        ftol=1e-9,
    )
    return statistic(recordings, effect.faults(values_at(found.x)))
