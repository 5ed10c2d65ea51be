"""Wear of nozzle and seat, line-side and sensor faults, as numbers with a sigma."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.scalars import NEEDLE_LAW, NOZZLE, NOZZLE_LAW, SCALARS, SEAT, WEIGHTS, Parameter
from observer_rt.foundation.units import Z_95
from observer_rt.model.accuracy import EXACT, StatedAccuracy
from observer_rt.model.network import OF_NOZZLE, activations

LEAST_SAC_PRESSURE = 0.05  # of p_0, below which a change of the nozzle flow is not spoken of
SIGNIFICANT = 2.0  # standard deviations, beyond which a nozzle changed otherwise at another rail pressure
# Of v_S: the flanks tell it, where what sensors do within a few samples (resonance, bounce) looks like wear.
LEAST_SEAT_SIGMA = 0.008
OPENED_SINCE = 1e-3  # s, at which a change of the nozzle flow is stated
# Of A_0 and p_0, at which a change of the seat flow is stated: there events tell most of it.
SEAT_AREA, SEAT_DROP = 0.3, 0.2
_NOZZLE, _SEAT = int(Parameter.NOZZLE_BIAS), int(Parameter.SEAT_BIAS)
_RISE, _RISE_WITH_SEAT = NOZZLE_LAW.columns.tolist()


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
    theta: NDArray[np.float64],
    covariance: NDArray[np.float64] | None,
    x: NDArray[np.float64],
    u: NDArray[np.float64],
    calibration: StatedAccuracy = EXACT,
    rails: Sequence[float] = (),
    has_lift: bool = True,
) -> Indicators:
    """Indicators by theta (m,) at state x (3,) and inputs u (2,), sigmas from its covariance (m, m).

    None but those of nozzle and seat enters Q_H^; these are no better known than the level, by `calibration`. rails:
    pressures [p_0] of recent events; by what the nozzle's change is another there, it is no wear. has_lift: it is
    recorded, so that nothing is learned of the needle.
    """
    nozzle, by_nozzle = nozzle_change(theta, x, u)
    seat, by_seat = seat_change(theta, SEAT_AREA, SEAT_DROP)
    of_flows = {NOZZLE: (float(nozzle), by_nozzle), SEAT: (float(seat), by_seat)}

    def estimate(effect: str, column: int) -> Estimate:
        value, slopes = of_flows.get(effect) or (float(theta[column]), np.eye(theta.size)[column])
        if covariance is None:
            return Estimate(value, None)
        variance = float(slopes @ covariance @ slopes)
        if effect in of_flows:
            variance += calibration.wear**2
        if effect == SEAT:
            variance += LEAST_SEAT_SIGMA**2
        if effect == NOZZLE:
            elsewhere = [_elsewhere(theta, covariance, x, u, rail) for rail in rails]
            variance += max(elsewhere, default=0.0)
        return Estimate(value, math.sqrt(variance))

    untold = NEEDLE_LAW.columns if has_lift else [Parameter.LIFT_DELAY]
    return {shown.effect: estimate(shown.effect, column) for column, shown in SCALARS.shown() if column not in untold}


def _elsewhere(
    theta: NDArray[np.float64],
    covariance: NDArray[np.float64],
    x: NDArray[np.float64],
    u: NDArray[np.float64],
    rail: float,
) -> float:
    """Square by which the nozzle's change is another at a rail pressure [p_0], beyond what may be an error of it."""
    here, slopes = nozzle_change(theta, x, u)
    ratio = rail / max(float(u[0]), LEAST_SAC_PRESSURE)
    changed, changed_slopes = nozzle_change(theta, ratio * x, np.array([rail, u[1]]))
    difference = changed_slopes - slopes
    return max(float((changed - here) ** 2 - SIGNIFICANT**2 * (difference @ covariance @ difference)), 0.0)


def nozzle_change(
    theta: NDArray[np.float64],
    x: Sequence[float] | NDArray[np.float64],
    u: Sequence[float | NDArray[np.float64]] | NDArray[np.float64],
    since: float | NDArray[np.float64] = OPENED_SINCE,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Relative change of the nozzle flow at states x (3, ...) and inputs u (2, ...), needle open; slopes (..., m).

    since: the needle opened [s]. (1 + N_H) sqrt((x3 - d)/x3) - 1: network and back-pressure d together, v_H of (27).
    """
    sigmas, area = activations(x, (u[0], u[1], since))[..., :OF_NOZZLE], u[1]
    factor = 1.0 + theta[_NOZZLE] + sigmas @ theta[WEIGHTS[:OF_NOZZLE]]
    x_3, rises = np.maximum(x[2], LEAST_SAC_PRESSURE), NOZZLE_LAW.of(theta)
    against_chamber = np.sqrt(np.maximum(1.0 - (rises[0] + rises[1] * area) / x_3, 0.0))
    slopes = np.zeros((*sigmas.shape[:-1], theta.size))
    slopes[..., _NOZZLE] = against_chamber
    slopes[..., WEIGHTS[:OF_NOZZLE]] = np.multiply(against_chamber[..., None], sigmas)
    some = np.where(against_chamber > 0.0, against_chamber, np.inf)
    slopes[..., _RISE] = -0.5 * factor / (x_3 * some)
    slopes[..., _RISE_WITH_SEAT] = slopes[..., _RISE] * area
    return factor * against_chamber - 1.0, slopes


def seat_change(
    theta: NDArray[np.float64], area: float | NDArray[np.float64], drop: float | NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Relative change N_S of the seat flow (...) at a seat area [A_0] and a pressure drop [p_0]; slopes (..., m)."""
    sigmas = activations((drop, 0.0, 0.0), (0.0, area, 0.0))[..., OF_NOZZLE:]
    slopes = np.zeros((*sigmas.shape[:-1], theta.size))
    slopes[..., _SEAT] = 1.0
    slopes[..., WEIGHTS[OF_NOZZLE:]] = sigmas
    return slopes @ theta, slopes
