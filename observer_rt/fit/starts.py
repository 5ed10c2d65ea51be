"""Where a search begins: the stiffness and damping of the line, of many, that explain the recordings best.

How long a wave takes to and fro decides which period of the ringing the model's falls upon: from a stiffness 5 %
wrong (at 20 kHz) a search ends beside the minimum, with no damping or at the edge of what its cells can step.
"""

import math
from collections.abc import Sequence

import numpy as np

from observer_rt.fit.parts import Part, thinned
from observer_rt.fit.problem import Calibration
from observer_rt.fit.search import FailedStructure, Fitted, fitted
from observer_rt.fit.structures import STIFFNESS, WAVE_DAMPING, FreeParameter, Structure, with_values
from observer_rt.model.parameters import InjectorParameters

STIFFNESSES = np.exp(np.linspace(-0.7, 0.7, 29))  # of what is known: within a factor of two, 5 % apart
SPARE = 1.2  # by which the stiffness that a search begins with may be too small
DAMPINGS = (0.5, 2.0)  # m2/s; a strong one makes the minimum wide
EXPLAINED = 1.5  # mean chi2, below which a search has not ended beside the minimum


def searched(
    structure: Structure,
    file: InjectorParameters,
    free: Sequence[FreeParameter],
    parts: Sequence[Part],
    iterations: int,
    explained: bool,
) -> Fitted | FailedStructure:
    """A structure fitted from the numbers of the file, the line's stiffness and damping being sought first.

    A line in one lump has no travelling waves: the file's numbers do. Where a search ends with much unexplained
    they are sought once more, by the orifices found by then; not where a simpler structure has `explained` it all.
    """
    if WAVE_DAMPING not in structure.free:
        return fitted(structure, file, free, parts, iterations)
    few = tuple(thinned(part, 1) for part in parts)
    found = fitted(structure, _best(structure, _around(file), free, few), free, parts, iterations, SPARE)
    if explained or isinstance(found, FailedStructure) or explains(found):
        return found
    here = found.injector
    again = _best(structure, [here, *_around(here)], free, few)
    if again is here:
        return found
    other = fitted(structure, again, free, parts, iterations, SPARE)
    return other if isinstance(other, Fitted) and other.minimum.statistic < found.minimum.statistic else found


def explains(one: Fitted | FailedStructure) -> bool:
    """Whether a structure leaves little more than noise."""
    return isinstance(one, Fitted) and one.left.mean < EXPLAINED


def _around(injector: InjectorParameters) -> list[InjectorParameters]:
    return [
        with_values(injector, (STIFFNESS, WAVE_DAMPING), np.array([stiffness, damping]))
        for stiffness in STIFFNESS.of(injector) * STIFFNESSES
        for damping in DAMPINGS
    ]


def _best(
    structure: Structure,
    starts: Sequence[InjectorParameters],
    free: Sequence[FreeParameter],
    parts: Sequence[Part],
) -> InjectorParameters:
    """Of several; by one event of each operating point, nothing fitted."""
    return min(starts, key=lambda start: _statistic(structure.of(start), free, parts))


def _statistic(injector: InjectorParameters, free: Sequence[FreeParameter], parts: Sequence[Part]) -> float:
    """-2 log L at an injector; inf where the model has no solution."""
    calibration = Calibration(injector, free, parts)
    residuals = calibration.residuals(calibration.centre)
    return math.inf if residuals is None or math.isnan(residuals.statistic) else residuals.statistic
