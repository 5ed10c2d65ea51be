"""The course of a quantity seen with noise, as a local linear trend: level and slope wander, each as it shows."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Signal = NDArray[np.float64]
SURE = 1.959964  # standard deviations of a 95 % interval
_LEVEL_WANDERS, _SLOPE_WANDERS = np.geomspace(0.03, 1.0, 8), np.geomspace(0.003, 2.0, 6)
"""Ways to wander that are tried, in parts of what the sightings span, over their time; so are the next."""
_PRIOR_LEVEL, _PRIOR_SLOPE, _LEAST_SIGMA = 10.0, 3.0, 1e-4  # standard deviations
_LEAST_SPAN = 1e-6


@dataclass(frozen=True, eq=False)
class CourseEnd:
    """What may be true at the last sighting, in parts of what the sightings span, over the time that they do.

    scale: what they span; weight, (g,): of how level and slope may wander (g,); state, (g, 2), and
    its covariance, (g, 2, 2).
    """

    scale: float
    weight: Signal
    level_wanders: Signal
    slope_wanders: Signal
    state: Signal
    covariance: Signal


@dataclass(frozen=True, eq=False)
class Course:
    """A quantity at its sightings, (n,): each by itself with its standard deviation, all smoothed.

    place: days or operating hours since the first sighting; slope: at the last one, of the quantity by place.
    """

    place: Signal
    value: Signal
    sigma: Signal
    level: Signal
    level_sigma: Signal
    slope: float = 0.0
    slope_sigma: float = 0.0
    end: CourseEnd | None = field(default=None, repr=False)

    @property
    def band(self) -> tuple[Signal, Signal]:
        """Ends of the 95 % interval of the level."""
        return self.level - SURE * self.level_sigma, self.level + SURE * self.level_sigma

    @property
    def leap(self) -> float:
        """Root mean square of the level's change from one sighting to the next."""
        return float(np.sqrt(np.mean(np.diff(self.level) ** 2))) if self.level.size > 1 else 0.0


def smoothed(place: Signal, value: Signal, sigma: Signal) -> Course:
    """What all sightings (n,) at rising places say of a quantity at each.

    How much level and slope wander nobody knows: each pair counts by how likely it makes the sightings.
    """
    if value.size == 0:
        return Course(place, value, sigma, value, sigma)
    reach = float(np.ptp(place)) or 1.0
    scale = max(float(np.ptp(value)), float(np.median(sigma)), _LEAST_SPAN)
    level_wanders, slope_wanders = (each.ravel() for each in np.meshgrid(_LEVEL_WANDERS, _SLOPE_WANDERS))
    states, covariances, surprise = _smoothed(
        np.diff(place) / reach,
        (value - value[0]) / scale,
        np.maximum(sigma / scale, _LEAST_SIGMA),
        level_wanders,
        slope_wanders,
    )
    weight = np.exp(-0.5 * (surprise - surprise.min()))
    weight /= weight.sum()
    state = np.einsum("g,ngi->ni", weight, states)
    spread = np.einsum("ngii->ngi", covariances) + (states - state[:, None]) ** 2
    deviation = np.sqrt(np.einsum("g,ngi->ni", weight, spread))
    return Course(
        place,
        value,
        sigma,
        value[0] + scale * state[:, 0],
        scale * deviation[:, 0],
        float(state[-1, 1] * scale / reach),
        float(deviation[-1, 1] * scale / reach),
        CourseEnd(scale, weight, level_wanders, slope_wanders, states[-1], covariances[-1]),
    )


def _smoothed(
    gaps: Signal, value: Signal, sigma: Signal, level_wanders: Signal, slope_wanders: Signal
) -> tuple[Signal, Signal, Signal]:
    """Kalman's filter forth, the Rauch-Tung-Striebel smoother back, with every pair (g,) of wanderings at once.

    Returns level and slope, (n, g, 2), their covariances, (n, g, 2, 2), and minus twice the logarithm of the pairs'
    likelihoods, (g,).
    """
    pairs = level_wanders.size
    states, covariances = np.zeros((value.size, pairs, 2)), np.zeros((value.size, pairs, 2, 2))
    state, covariance = (
        np.zeros((pairs, 2)),
        np.tile(np.diag([_PRIOR_LEVEL, _PRIOR_SLOPE]) ** 2, (pairs, 1, 1)),
    )
    surprise, ahead = np.zeros(pairs), []
    for k in range(value.size):
        if k:
            step = np.array([[1.0, gaps[k - 1]], [0.0, 1.0]])
            moved = step @ covariance
            state, covariance = state @ step.T, moved @ step.T
            covariance += _wandered(gaps[k - 1], level_wanders, slope_wanders)
            ahead.append((moved, state, covariance))
        expected = covariance[:, 0, 0] + sigma[k] ** 2
        error = value[k] - state[:, 0]
        surprise += error**2 / expected + np.log(expected)
        gain = covariance[:, :, 0] / expected[:, None]
        state = state + gain * error[:, None]
        covariance = covariance - gain[:, :, None] * covariance[:, None, 0, :]
        states[k], covariances[k] = state, covariance
    for k in range(value.size - 2, -1, -1):
        moved, expected_state, expected_covariance = ahead[k]
        back = np.swapaxes(np.linalg.solve(expected_covariance, moved), 1, 2)
        states[k] += np.einsum("gij,gj->gi", back, states[k + 1] - expected_state)
        covariances[k] += back @ (covariances[k + 1] - expected_covariance) @ np.swapaxes(back, 1, 2)
    return states, covariances, surprise


def _wandered(gap: float, level_wanders: Signal, slope_wanders: Signal) -> Signal:
    """Covariance, (g, 2, 2), of what level and slope have wandered in a gap."""
    of_slope = np.array([[gap**3 / 3.0, gap**2 / 2.0], [gap**2 / 2.0, gap]])
    found: Signal = slope_wanders[:, None, None] ** 2 * of_slope
    found[:, 0, 0] += level_wanders**2 * gap
    return found
