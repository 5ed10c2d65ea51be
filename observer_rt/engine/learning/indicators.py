"""Indicators: wear of nozzle and seat, faults of line and sensors, each a number with a standard deviation."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation import scalars
from observer_rt.engine.estimation.belief import Matrix, Vector
from observer_rt.foundation.units import Z_95
from observer_rt.model.accuracy import EXACT, StatedAccuracy
from observer_rt.model.network import OF_NOZZLE, activations

LEAST_SAC_PRESSURE = 0.05  # p_0, down to which a change of the nozzle flow is stated
SIGNIFICANT = 2.0  # standard deviations, beyond which a nozzle changed otherwise at another rail pressure
# Of v_S: the flanks tell it, and what sensors do there within a few samples (resonance, bounce) looks like wear.
LEAST_SEAT_SIGMA = 0.008
OPENED_SINCE = 1e-3  # s, at which a change of the nozzle flow is stated
# Of A_0 and p_0, at which a change of the seat flow is stated: there events tell most of it.
SEAT_AREA, SEAT_DROP = 0.3, 0.2
_NOZZLE, _SEAT = int(scalars.Parameter.NOZZLE_BIAS), int(scalars.Parameter.SEAT_BIAS)
_RISE, _RISE_WITH_SEAT = scalars.NOZZLE_LAW.columns.tolist()
Floats = float | NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """A number and its standard deviation, None where nothing was learned yet."""

    value: float
    sigma: float | None = None

    @property
    def ci95(self) -> tuple[float, float] | None:
        """95 % interval."""
        if self.sigma is None:
            return None
        return self.value - Z_95 * self.sigma, self.value + Z_95 * self.sigma


Indicators = Mapping[str, Estimate]
"""Estimates by the effects they stand for, normalised as theta; those of nozzle and seat are v_H and v_S of (27)."""


def indicators_of(
    theta: scalars.Theta,
    covariance: Matrix | None,
    x: Vector,
    u: Vector,
    calibration: StatedAccuracy = EXACT,
    rails: Sequence[float] = (),
    has_lift: bool = True,
) -> Indicators:
    """Indicators by theta (m,) at state x (3,) and inputs u (2,), their sigmas by its covariance (m, m).

    Those of nozzle and seat, the only ones that enter Q_H^, are no better known than the level, by `calibration`.
    rails: pressures [p_0] of recent events; the difference of the nozzle's change between them is no wear, but widens
    its sigma. has_lift: the lift is recorded, so that nothing is learned of the needle.
    """
    nozzle, by_nozzle = nozzle_change(theta, x, u)
    seat, by_seat = seat_change(theta, SEAT_AREA, SEAT_DROP)
    of_flows = {scalars.NOZZLE: (float(nozzle), by_nozzle), scalars.SEAT: (float(seat), by_seat)}

    def estimate(effect: str, column: int) -> Estimate:
        value, slopes = of_flows.get(effect) or (float(theta[column]), np.eye(theta.size)[column])
        if covariance is None:
            return Estimate(value, None)
        variance = float(slopes @ covariance @ slopes)
        if effect in of_flows:
            variance += calibration.wear**2
        if effect == scalars.SEAT:
            variance += LEAST_SEAT_SIGMA**2
        if effect == scalars.NOZZLE:
            variance += max((_difference_at(theta, covariance, x, u, rail) for rail in rails), default=0.0)
        return Estimate(value, math.sqrt(variance))

    idle = scalars.NEEDLE_LAW.columns if has_lift else [scalars.Parameter.LIFT_DELAY]
    return {
        shown.effect: estimate(shown.effect, column)
        for column, shown in scalars.SCALARS.shown()
        if column not in idle
    }


def _difference_at(theta: scalars.Theta, covariance: Matrix, x: Vector, u: Vector, rail: float) -> float:
    """Square by which the nozzle's change at a rail pressure [p_0] differs from that here, less a possible error."""
    here, slopes = nozzle_change(theta, x, u)
    ratio = rail / max(float(u[0]), LEAST_SAC_PRESSURE)
    changed, changed_slopes = nozzle_change(theta, ratio * x, np.array([rail, u[1]]))
    difference = changed_slopes - slopes
    return max(float((changed - here) ** 2 - SIGNIFICANT**2 * (difference @ covariance @ difference)), 0.0)


def nozzle_change(
    theta: scalars.Theta, x: Sequence[float] | Vector, u: Sequence[Floats] | Vector, since: Floats = OPENED_SINCE
) -> tuple[Vector, Matrix]:
    """Relative change (...) of the nozzle flow at states x (3, ...) and inputs u (2, ...); slopes (..., m).

    (1 + N_H) sqrt((x3 - d)/x3) - 1: network and back-pressure d, v_H of (27). since: needle open for so many s.
    """
    sigmas, area = activations(x, (u[0], u[1], since))[..., :OF_NOZZLE], u[1]
    factor = 1.0 + theta[_NOZZLE] + sigmas @ theta[scalars.WEIGHTS[:OF_NOZZLE]]
    x_3, rises = np.maximum(x[2], LEAST_SAC_PRESSURE), scalars.NOZZLE_LAW.of(theta)
    against_chamber = np.sqrt(np.maximum(1.0 - (rises[0] + rises[1] * area) / x_3, 0.0))
    slopes = np.zeros((*sigmas.shape[:-1], theta.size))
    slopes[..., _NOZZLE] = against_chamber
    slopes[..., scalars.WEIGHTS[:OF_NOZZLE]] = np.multiply(against_chamber[..., None], sigmas)
    divisor = np.where(against_chamber > 0.0, against_chamber, np.inf)  # without flow no slope
    slopes[..., _RISE] = -0.5 * factor / (x_3 * divisor)
    slopes[..., _RISE_WITH_SEAT] = slopes[..., _RISE] * area
    return factor * against_chamber - 1.0, slopes


def seat_change(theta: scalars.Theta, area: Floats, drop: Floats) -> tuple[Vector, Matrix]:
    """Relative change N_S of the seat flow (...) at a seat area [A_0] and a pressure drop [p_0]; slopes (..., m)."""
    sigmas = activations((drop, 0.0, 0.0), (0.0, area, 0.0))[..., OF_NOZZLE:]
    slopes = np.zeros((*sigmas.shape[:-1], theta.size))
    slopes[..., _SEAT] = 1.0
    slopes[..., scalars.WEIGHTS[OF_NOZZLE:]] = sigmas
    return slopes @ theta, slopes
