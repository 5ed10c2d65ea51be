"""Peers on the richer plant: the joint UKF on the paper's lump, as its maker says, fitted, fitted with measured rate.

Least squares on the whitened innovations of the peers' own predictor, its gain recomputed; on the measured rate too
where there is one. The sac of a few mm3 follows without delay: filling it takes a thousandth of the mass.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from tools.benchmarks.cases import Case
from tools.benchmarks.joint_fit import innovations, open_loop_rate, segments_of, steady_gain
from tools.benchmarks.kalman_peers import joint_ukf
from tools.benchmarks.peer_equations import PARAMETERS, Model
from tools.benchmarks.peer_inputs import lump_model, peer_inputs
from tools.benchmarks.peers import TUNING, PeerScore, peer_score
from tools.benchmarks.plant import Outcome, record
from tools.benchmarks.plant_parameters import Injector
from tools.benchmarks.wave_plant import new_part

RATE_NOISE = 0.5e-6  # m3/s, of a sample of a measured rate
EVENTS_USED = 2  # of each recording
SPREAD = 1.0  # of the logarithms of stiffness, loss, seat and nozzle: they may be off by some factor
NOMINAL_LUMP, FITTED_LUMP, RATE_LUMP = "UKF nominal lump", "UKF fitted lump", "UKF lump, rate"
NO_FAULT = np.zeros(PARAMETERS)


def lumps_of(healthy: Sequence[Outcome]) -> Mapping[str, Model]:
    """The peers' models by the peers' names, fitted to these recordings."""
    return {
        NOMINAL_LUMP: lump_model(new_part(), sac_follows=True),
        FITTED_LUMP: fitted_lump(healthy, new_part(), with_rate=False),
        RATE_LUMP: fitted_lump(healthy, new_part(), with_rate=True),
    }


def score_wave_peers(case: Case, lumps: Mapping[str, Model]) -> PeerScore:
    """Record a case and score the joint UKF on every lump."""
    outcome = record(case.bench)
    inputs = {name: peer_inputs(outcome.measured, model) for name, model in lumps.items()}
    return peer_score(case, outcome, {name: joint_ukf(each, TUNING).rate for name, each in inputs.items()})


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
