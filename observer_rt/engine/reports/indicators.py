"""Indicators: wear of nozzle and seat, faults of line and sensors, each a number with a standard deviation."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from observer_rt.engine.estimation import parameters
from observer_rt.engine.estimation.belief import Matrix, Vector
from observer_rt.engine.learning.mass import LEAST_SAC_PRESSURE, nozzle_change, seat_change
from observer_rt.foundation.units import Z_95
from observer_rt.model.accuracy import EXACT, StatedAccuracy

SIGNIFICANT = 2.0  # standard deviations, beyond which a nozzle changed otherwise at another rail pressure
# Of v_S: the flanks tell it, and what sensors do there within a few samples (resonance, bounce) looks like wear.
LEAST_SEAT_SIGMA = 0.008
# Of A_0 and p_0, at which a change of the seat flow is stated: there events tell most of it.
SEAT_AREA, SEAT_DROP = 0.3, 0.2


@dataclass(frozen=True)
class Estimate:
    """A number and its standard deviation, None where nothing was learned yet."""

    value: float
    sigma: float | None = None

    @property
    def ci95(self) -> tuple[float, float] | None:
        if self.sigma is None:
            return None
        return self.value - Z_95 * self.sigma, self.value + Z_95 * self.sigma


Indicators = Mapping[str, Estimate]
"""Estimates by the effects they stand for, normalised as theta; those of nozzle and seat are v_H and v_S of (27)."""


def indicators_of(
    theta: parameters.Theta,
    covariance: Matrix | None,
    x: Vector,
    u: Vector,
    calibration: StatedAccuracy = EXACT,
    rails: Sequence[float] = (),
    has_lift: bool = True,
) -> Indicators:
    """Indicators by theta (m,) at state x (3,) and inputs u (2,), their sigmas by its covariance (m, m).

    Those of nozzle and seat, alone in Q_H^, are no better known than the level (`calibration`). rails: recent
    pressures [p_0]; a difference of the nozzle between them is no wear, but widens its sigma. has_lift: it is
    recorded.
    """
    nozzle, by_nozzle = nozzle_change(theta, x, u)
    seat, by_seat = seat_change(theta, SEAT_AREA, SEAT_DROP)
    of_flows = {parameters.NOZZLE: (float(nozzle), by_nozzle), parameters.SEAT: (float(seat), by_seat)}

    def estimate(effect: str, column: int) -> Estimate:
        value, slopes = of_flows.get(effect) or (float(theta[column]), np.eye(theta.size)[column])
        if covariance is None:
            return Estimate(value, None)
        variance = float(slopes @ covariance @ slopes)
        if effect in of_flows:
            variance += calibration.wear**2
        if effect == parameters.SEAT:
            variance += LEAST_SEAT_SIGMA**2
        if effect == parameters.NOZZLE:
            variance += max((_difference_at(theta, covariance, x, u, rail) for rail in rails), default=0.0)
        return Estimate(value, math.sqrt(variance))

    idle = parameters.NEEDLE_LAW.columns if has_lift else [parameters.Parameter.LIFT_DELAY]
    return {
        shown.effect: estimate(shown.effect, column)
        for column, shown in parameters.SCALARS.shown()
        if column not in idle
    }


def _difference_at(theta: parameters.Theta, covariance: Matrix, x: Vector, u: Vector, rail: float) -> float:
    """Square of how the nozzle's change at a rail pressure [p_0] differs from that here, less a possible error."""
    here, slopes = nozzle_change(theta, x, u)
    ratio = rail / max(float(u[0]), LEAST_SAC_PRESSURE)
    changed, changed_slopes = nozzle_change(theta, ratio * x, np.array([rail, u[1]]))
    difference = changed_slopes - slopes
    return max(float((changed - here) ** 2 - SIGNIFICANT**2 * (difference @ covariance @ difference)), 0.0)
