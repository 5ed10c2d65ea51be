"""Whether what was learned can be true of any injector."""

import math
from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.gain import NoiseLevels
from observer_rt.estimation.scalars import SCALARS
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE
from observer_rt.observer.learning.disturbances.colour import ORDERS, Colour
from observer_rt.observer.learning.knowledge import Knowledge, no_knowledge

LARGEST_NOISE = NoiseLevels(  # beyond these the sensor is broken, or the needle would never count as open
    rail_pressure=10 * MEGAPASCAL, line_pressure=10 * MEGAPASCAL, needle_lift=20 * MICROMETRE
)


def problem_of(knowledge: Knowledge, pressure_scale: float) -> str | None:
    """What makes knowledge impossible or implausible, in a few words; None if nothing does.

    pressure_scale: p_0 [Pa], by which the bounds are counted.
    """
    prior = no_knowledge(knowledge.noise, pressure_scale)
    for part, like in zip(_arrays(knowledge), _arrays(prior), strict=True):
        if part.shape != like.shape:
            return f"it holds parameters of another kind: shape {part.shape} instead of {like.shape}"
    lowest, highest = SCALARS.bounds(pressure_scale)
    for name, theta in (("the mean", knowledge.belief.mean), ("the parameters in force", knowledge.in_force)):
        if not np.all(np.isfinite(theta)):
            return f"{name} are not finite numbers"
    if np.any(knowledge.in_force < lowest) or np.any(knowledge.in_force > highest):
        return "the parameters in force lie beyond what an injector can do"
    # the mean is free of the bounds' signs: it may say that a leak is slightly negative
    if np.any(np.abs(knowledge.belief.mean) > np.maximum(-lowest, highest)):
        return "the mean lies beyond what an injector can do"
    for name, covariance in (
        ("the covariance", knowledge.belief.covariance),
        ("the error's covariance", knowledge.belief.error_covariance),
    ):
        if not np.all(np.isfinite(covariance)):
            return f"{name} is not finite"
        if not np.array_equal(covariance, covariance.T) or not _is_positive_definite(covariance):
            return f"{name} is not symmetric and positive definite"
    if not all(np.all(np.isfinite(sums) & (sums >= 0.0)) for sums in vars(knowledge.statistics).values()):
        return "the statistics of the innovations are no sums of squares"
    for signal, sigma in asdict(knowledge.noise).items():
        if not (math.isfinite(sigma) and 0.0 < sigma <= getattr(LARGEST_NOISE, signal)):
            return f"the noise of the {signal.replace('_', ' ')} is {sigma:g} (SI units)"
    if not np.all(np.isfinite(knowledge.learned_at)):
        return "the operating points learned at are not finite numbers"
    return None if knowledge.colour is None else _problem_of_colour(knowledge.colour)


def _problem_of_colour(colour: Colour) -> str | None:
    whitening = colour.whitening
    if whitening.taps.ndim != 1 or whitening.taps.size > ORDERS or not np.all(np.isfinite(whitening.taps)):
        return f"the colour of the noise is no filter of at most {ORDERS} taps"
    if not all(math.isfinite(value) and value > 0.0 for value in (colour.sigma, colour.interval)):
        return "the colour of the noise has no level or no sample interval"
    if whitening.forgetting is not None and not 0.0 < whitening.forgetting < 1.0:
        return "the high pass of the noise is none"
    return None


def _arrays(knowledge: Knowledge) -> list[NDArray[np.float64]]:
    return [knowledge.in_force, *knowledge.belief.parts.values(), *vars(knowledge.statistics).values()]


def _is_positive_definite(matrix: NDArray[np.float64]) -> bool:
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True
