"""Rules by which learned knowledge is possible and plausible: read from a file it may be neither."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.stream.stream import FURTHEST_ZERO, MOST_CROSSTALK
from observer_rt.engine.estimation.parameters import SCALARS, sensor_lag
from observer_rt.engine.learning.adequacy import LARGEST_LAG, is_worn_beyond_limits
from observer_rt.engine.learning.knowledge import Knowledge, LearnedInjector


def problem_of(knowledge: Knowledge, pressure_scale: float) -> str | None:
    """Fault that makes knowledge impossible or implausible, in a few words; None without a fault.

    pressure_scale: p_0 [Pa], by which the bounds are counted. A file sees to it that numbers are finite.
    """
    state = knowledge.state
    lowest, highest = SCALARS.bounds(pressure_scale)
    if np.any(knowledge.in_force < lowest) or np.any(knowledge.in_force > highest):
        return "the parameters in force lie beyond what an injector can do"
    if problem := _problem_of_belief(state.learned, np.maximum(-lowest, highest)):
        return problem
    if odd := state.noise.implausible:
        return f"the noise of the {odd[0].replace('_', ' ')} is {getattr(state.noise, odd[0]):g} (SI units)"
    lift = knowledge.lift
    is_drift = abs(lift.zero) <= FURTHEST_ZERO and 0.0 <= lift.wander <= FURTHEST_ZERO
    if not (is_drift and abs(lift.crosstalk) <= MOST_CROSSTALK):
        return f"the lift of a shut needle shows more than a sensor's drift: {lift}"
    return None


def _problem_of_belief(learned: LearnedInjector, farthest: NDArray[np.float64]) -> str | None:
    """Fault of one belief likewise; farthest: largest size (m,) of each parameter."""
    belief = learned.belief
    # the mean is free of the bounds' signs: it may say that a leak is slightly negative
    if np.any(np.abs(belief.mean) > farthest):
        return "the mean lies beyond what an injector can do"
    covariances = {"the covariance": belief.covariance, "the error's covariance": belief.error_covariance}
    for name, covariance in covariances.items():
        if not np.array_equal(covariance, covariance.T) or not _is_positive_definite(covariance):
            return f"{name} is not symmetric and positive definite"
    return None


def doubt_of(knowledge: Knowledge) -> str | None:
    """Reason why every event would be refused with restored knowledge, in a few words; None without a reason.

    A run that learns of such a sensor reports a fault; a later run may have other signals. An offset is no reason:
    one that follows the rail pressure is a gain, with which learning goes on.
    """
    for theta in (knowledge.state.learned.belief.mean, knowledge.in_force):
        lag = sensor_lag(theta)
        if lag > LARGEST_LAG:
            return f"its lag of the line-pressure sensor, {lag * 1e3:.2g} ms, is more than {LARGEST_LAG * 1e3:g} ms"
        if is_worn_beyond_limits(theta):
            return "its nozzle or seat is at the limit of what an injector can do"
    return None


def _is_positive_definite(matrix: NDArray[np.float64]) -> bool:
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True
