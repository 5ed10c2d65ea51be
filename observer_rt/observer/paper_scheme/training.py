"""Algorithm 1: the paper's training of phi on one event."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.predictor import Window
from observer_rt.model.coefficients import Coefficients
from observer_rt.model.network import constant_network
from observer_rt.observer.paper_scheme.bfgs import minimise
from observer_rt.observer.paper_scheme.network import (
    WEIGHTS,
    FreeNetwork,
    fault_cost,
    free_network,
    no_fault,
    scaled_identity,
)
from observer_rt.observer.paper_scheme.systems import EventPass, PaperSetting, design_vector, swept

EPOCHS = 30
BETA = 0.1  # of the scaled identities the weights start from
GAMMA = 1.0  # of the first approximation of the Hessian; of its inverse alike


@dataclass(frozen=True)
class Trained:
    """What one training came to: the trained weights p (48,), J before and after, epochs used."""

    weights: NDArray[np.float64]
    cost_before: float
    cost_after: float
    epochs: int


@dataclass(frozen=True)
class Weights:
    """Weights p (48,) of the paper's network on their way from event to event.

    in_force: what x^ carries, phi = 0 at first; trained: where the next training starts.
    """

    in_force: NDArray[np.float64]
    trained: NDArray[np.float64]


def first_weights() -> Weights:
    """phi = 0 in force, and the scaled identities of Algorithm 1 to start from."""
    return Weights(no_fault(), scaled_identity(BETA))


def paper_setting(c: Coefficients, interval: float, substeps: int, gain: float) -> PaperSetting:
    """Setting for a model, a sample interval [s] with its RK4 steps, and a gain l [1/s]."""
    return PaperSetting(interval, substeps, c, constant_network(), gain)


def network_of(weights: NDArray[np.float64], setting: PaperSetting) -> FreeNetwork:
    """The network of weights p (48,), its outputs in units of the gain."""
    return free_network(weights, setting.gain)


def train(window: Window, setting: PaperSetting, weights: Weights) -> Trained:
    """One pass over the event with the weights in force, then 30 epochs from the trained ones.

    z is taken along x^, the target L l e~ from x~; both stay fixed while J is minimised (10).
    """
    seen = swept(window, setting, network_of(weights.in_force, setting))
    cost = fault_cost(*training_data(window, seen, setting), setting.gain)
    found = minimise(cost, weights.trained, np.eye(WEIGHTS) / GAMMA, tolerance=0.0, max_iterations=EPOCHS)
    return Trained(found.theta, cost.value(weights.trained), found.value, found.iterations)


def training_data(
    window: Window, seen: EventPass, setting: PaperSetting
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Arguments z = [x^ u 1] (k, 6) and targets L l e~ (k, 3) [1/s] of the k samples driven by phi."""
    z = np.column_stack(
        [seen.x, window.inputs[:, 0], np.maximum(window.inputs[:, 1], 0.0), np.ones(seen.error.size)]
    )
    target = setting.gain * np.outer(seen.error, design_vector(setting.coefficients))
    return z[seen.driven], target[seen.driven]


def output_error(window: Window, setting: PaperSetting, weights: NDArray[np.float64]) -> float:
    """Sum of squared output errors y - C x^ of the observer re-simulated with weights p (48,); inf if not finite."""
    seen = swept(window, setting, network_of(weights, setting))
    error = (window.output - seen.x[:, 0])[seen.driven]
    total = float(error @ error)
    return total if np.isfinite(total) else np.inf
