"""What the joint filters get on the richer plant: the paper's single lump, fitted to the healthy recordings.

Least squares on the whitened innovations of the peers' own predictor, its gain recomputed; on the measured rate too
where there is one. The sac of a few mm3 follows without delay: filling it takes a thousandth of the mass.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from tools.benchmarks.joint_fit import innovations, open_loop_rate, segments_of, steady_gain
from tools.benchmarks.peer_equations import PARAMETERS, Model
from tools.benchmarks.peer_inputs import lump_model, peer_inputs
from tools.benchmarks.plant import Outcome
from tools.benchmarks.plant_parameters import Injector

RATE_NOISE = 0.5e-6  # m3/s, of a sample of a measured rate
EVENTS_USED = 2  # of each recording
SPREAD = 1.0  # of the logarithms of stiffness, loss, seat and nozzle: they may be off by some factor
NO_FAULT = np.zeros(PARAMETERS)


def fitted_lump(outcomes: Sequence[Outcome], part: Injector, with_rate: bool) -> Model:
    """The lump whose innovations, and rates, are smallest."""

    def residuals(logs: NDArray[np.float64]) -> NDArray[np.float64]:
        model = lump_of(part, logs)
        return np.concatenate([_residuals(outcome, model, with_rate) for outcome in outcomes])

    found = least_squares(residuals, np.zeros(4), bounds=(-2.0, 2.0), x_scale=SPREAD, diff_step=1e-3)
    return lump_of(part, found.x)


def lump_of(part: Injector, logs: NDArray[np.float64]) -> Model:
    """The lump with stiffness, loss, seat and nozzle times exp(logs) (4,)."""
    stiffness, loss, seat, nozzle = np.exp(logs)
    changed = part._replace(
        bulk_modulus_line=part.bulk_modulus_line * stiffness,
        line_loss=part.line_loss * loss,
        seat_coefficient=part.seat_coefficient * seat,
        nozzle_area=part.nozzle_area * nozzle,
    )
    return lump_model(changed, sac_follows=True)


def _residuals(outcome: Outcome, model: Model, with_rate: bool) -> NDArray[np.float64]:
    inputs = peer_inputs(outcome.measured, model)
    gain, sigma = steady_gain(inputs, lag=0.0)
    found = []
    for segment in segments_of(inputs)[:EVENTS_USED]:
        found.append(innovations(inputs, segment, NO_FAULT, gain) / sigma)
        if with_rate:
            rate = open_loop_rate(inputs, segment, NO_FAULT, gain)
            noise = np.random.default_rng(segment.first).normal(0.0, RATE_NOISE, rate.size)
            measured = outcome.truth.injection_rate[segment.first : segment.closed] + noise
            found.append((measured - rate) / RATE_NOISE)
    return np.concatenate(found)
