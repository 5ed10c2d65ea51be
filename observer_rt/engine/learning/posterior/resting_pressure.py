"""Line against rail pressure while the needle is shut: what rest says of the gain of one sensor over the other's.

Offset and gain are distinguished by rest at several pressures, in one event (the rail dips) or from event to
event. This comes before the noise is given a colour: the misfit of a gain would be taken for one, and its high pass
would then hide the offset.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gating import Belief, HeldBelief, held_at, nothing_held
from observer_rt.engine.estimation.prediction_error import EventCost
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.estimation.scalars import EXACTLY, Parameter, Theta
from observer_rt.engine.learning.disturbances.noise_levels import mask_of
from observer_rt.foundation.units import MEGAPASCAL, MILLISECOND

BLOCK = 1 * MILLISECOND  # of which means are taken: about a period of the line
BLOCK_ERROR = 0.01 * MEGAPASCAL  # of such a mean, whatever the noise
# Of a block over the pressures within an event: how the rail recovers is alike in every event, and no gain.
SYSTEMATIC = 0.03 * MEGAPASCAL
# Standard deviations beyond a belief: another sensor, or one that is not straight, tells no gain.
SIGNIFICANT = 5.0
_OFFSET, _GAIN = int(Parameter.LINE_PRESSURE_OFFSET), int(Parameter.LINE_PRESSURE_GAIN)
_BOTH = [_OFFSET, _GAIN]


@dataclass(frozen=True, eq=False)
class RestingPressure:
    """Means of innovations over blocks of an event's rest.

    means: (k,) at theta (m,); slopes: (k, 2) by offset and gain; noise: variance of a mean by it; pressure_scale: p_0
    [Pa].
    """

    theta: Theta
    means: NDArray[np.float64]
    slopes: NDArray[np.float64]
    noise: float
    pressure_scale: float

    def held(self, belief: Belief) -> HeldBelief:
        """The belief with the gain as rest says; as it is where sensors have none."""
        own = float(belief.covariance[_GAIN, _GAIN])
        if own <= 2.0 * EXACTLY**2:
            return nothing_held(belief)
        value, variance = self._gain(belief)
        return held_at(belief, _GAIN, value, min(variance, own))

    def _gain(self, belief: Belief) -> tuple[float, float]:
        """Gain and its variance after the rest."""
        before, prior = belief.mean[_BOTH], belief.covariance[np.ix_(_BOTH, _BOTH)]
        if not self.means.size:
            return float(before[1]), float(prior[1, 1])
        means = self.means + self.slopes @ (before - self.theta[_BOTH])
        middle, mean = self.slopes.mean(axis=0), float(means.mean())
        error = (BLOCK_ERROR / self.pressure_scale) ** 2
        of_mean, of_block = self.noise / means.size + error, self.noise + error
        if mean**2 > SIGNIFICANT**2 * (of_mean + middle @ prior @ middle):
            return float(before[1]), float(prior[1, 1])
        by_mean, of_means = _taught(prior, middle[None, :], np.array([mean]), of_mean)
        by_blocks, of_blocks = _taught(prior, self.slopes, means, of_block)
        least = (SYSTEMATIC / self.pressure_scale / max(float(np.ptp(self.slopes[:, 1])), EXACTLY)) ** 2
        variance = of_means - of_blocks
        share = min(max((of_means - least) / variance, 0.0), 1.0) if variance > 0.0 else 0.0
        gain = before[1] + (1.0 - share) * by_mean + share * by_blocks
        return float(gain), (1.0 - share) * of_means + share * of_blocks


def _taught(
    prior: NDArray[np.float64], slopes: NDArray[np.float64], means: NDArray[np.float64], noise: float
) -> tuple[float, float]:
    """Change of the gain by innovations (k,) with slopes (k, 2), each with a variance, and what it then has."""
    along = prior[1] @ slopes.T
    spread = slopes @ prior @ slopes.T + noise * np.eye(means.size)
    weights = np.linalg.solve(spread, along)
    return float(-weights @ means), float(prior[1, 1] - weights @ along)


def resting_pressure(
    window: Window, cost: EventCost, theta: Theta, interval: float, pressure_scale: float
) -> RestingPressure:
    """Rest of an event whose cost was linearised at theta (m,) last; interval of samples [s], p_0 [Pa]."""
    length = max(round(BLOCK / interval), 1)
    counts = window.resting & ~mask_of(window)
    counts[: cost.burn_in] = False
    at_rest = np.flatnonzero(counts)
    places = at_rest[at_rest.size % length :].reshape(-1, length)
    means = cost.unfiltered[places].mean(axis=1)
    slopes = cost.unfiltered_slopes[places][:, :, _BOTH].mean(axis=1)
    scatter = 0.5 * float(np.mean(np.diff(means) ** 2)) if means.size > 1 else 0.0
    return RestingPressure(theta, means, slopes, max(cost.sigma**2 / length, scatter), pressure_scale)
