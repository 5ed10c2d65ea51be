"""Wear of nozzle and seat, line-side and sensor faults, as numbers with a sigma."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.model import changes_and_activations
from observer_rt.engine.estimation.scalars import NOZZLE, SCALARS, SEAT, Parameter, network_of
from observer_rt.model.accuracy import EXACT, StatedAccuracy
from observer_rt.model.network import HIDDEN

LEAST_SAC_PRESSURE = 0.05  # of p_0, below which a change of the nozzle flow is not spoken of
SIGNIFICANT = 2.0  # standard deviations, beyond which a nozzle changed otherwise at another rail pressure
# Of v_S: the flanks tell it, where what sensors do within a few samples (resonance, bounce) looks like wear.
LEAST_SEAT_SIGMA = 0.008
_NOZZLE, _WEIGHTS = int(Parameter.NOZZLE_BIAS), int(Parameter.NOZZLE_WEIGHT)
_RISE, _RISE_WITH_SEAT = SCALARS.nozzle.columns.tolist()


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
        return self.value - 1.96 * self.sigma, self.value + 1.96 * self.sigma


Indicators = Mapping[str, Estimate]
"""Estimates by the effects they stand for, normalised as theta; those of nozzle and seat are v_H and v_S of (27)."""


def indicators_of(
    theta: NDArray[np.float64],
    covariance: NDArray[np.float64] | None,
    x: NDArray[np.float64],
    u: NDArray[np.float64],
    calibration: StatedAccuracy = EXACT,
    rails: Sequence[float] = (),
) -> Indicators:
    """Indicators by theta (m,) at state x (3,) and inputs u (2,), sigmas from its covariance (m, m).

    None but those of nozzle and seat enters Q_H^; these are no better known than the level, by `calibration`. rails:
    pressures [p_0] of recent events; by what the nozzle's change is another there, it is no wear.
    """
    nozzle, slopes = nozzle_change(theta, x, u)

    def estimate(effect: str, column: int) -> Estimate:
        if effect == NOZZLE:
            value, variance = nozzle, None
            if covariance is not None:
                elsewhere = [_elsewhere(theta, covariance, x, u, rail) for rail in rails]
                variance = slopes @ covariance @ slopes + max(elsewhere, default=0.0)
        else:
            value, variance = theta[column], None if covariance is None else covariance[column, column]
            if variance is not None and effect == SEAT:
                variance = variance + LEAST_SEAT_SIGMA**2
        if variance is not None and effect in (NOZZLE, SEAT):
            variance = variance + calibration.wear**2
        return Estimate(float(value), None if variance is None else float(np.sqrt(variance)))

    return {shown.effect: estimate(shown.effect, column) for column, shown in SCALARS.shown()}


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
    there, others = nozzle_change(theta, ratio * x, np.array([rail, u[1]]))
    apart = others - slopes
    return max(float((there - here) ** 2 - SIGNIFICANT**2 * (apart @ covariance @ apart)), 0.0)


def nozzle_change(
    theta: NDArray[np.float64],
    x: Sequence[float] | NDArray[np.float64],
    u: Sequence[float] | NDArray[np.float64],
) -> tuple[float, NDArray[np.float64]]:
    """Relative change of the nozzle flow at a state x (3,) and inputs u (2,), needle open; derivatives (m,).

    (1 + N_H) sqrt((x3 - d)/x3) - 1: network and back-pressure d together, the equivalent of v_H in (27).
    """
    network, slopes, area = network_of(theta), np.zeros(theta.size), float(u[1])
    change, _, activations = changes_and_activations(x, u, network)
    factor = 1.0 + change
    x_3 = max(float(x[2]), LEAST_SAC_PRESSURE)
    back_pressure = float(network.nozzle[0] + network.nozzle[1] * area)
    against_chamber = math.sqrt(max(1.0 - back_pressure / x_3, 0.0))
    slopes[_NOZZLE] = against_chamber
    slopes[_WEIGHTS : _WEIGHTS + HIDDEN] = against_chamber * np.array(activations)
    if against_chamber > 0.0:
        slopes[_RISE] = -0.5 * factor / (x_3 * against_chamber)
        slopes[_RISE_WITH_SEAT] = slopes[_RISE] * area
    return factor * against_chamber - 1.0, slopes
