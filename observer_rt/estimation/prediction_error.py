"""The cost of prediction-error learning: whitened innovations and a prior."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from observer_rt.estimation.posterior import Belief
from observer_rt.estimation.predictor import (
    Setting,
    Window,
    innovations,
    innovations_with_sensitivity,
)
from observer_rt.estimation.sensitivity import PARAMETERS, Parameter
from observer_rt.model.network import HIDDEN, Network, zero_network

HUBER = 4.0  # sigma beyond which an innovation counts linearly


def network_of(theta: NDArray[np.float64]) -> Network:
    """The network part of a parameter vector (PARAMETERS,)."""
    network = zero_network()
    network.output[0, :] = theta[Parameter.NOZZLE_WEIGHT : Parameter.NOZZLE_WEIGHT + HIDDEN]
    network.bias[:] = theta[[Parameter.NOZZLE_BIAS, Parameter.SEAT_BIAS]]
    return network


@njit(cache=True, nogil=True)
def robust_cost(e: NDArray[np.float64], first: int, sigma: float) -> float:
    """Huber cost of e[first:] / sigma: half the square up to HUBER, linear beyond."""
    total = 0.0
    for k in range(first, e.shape[0]):
        z = math.fabs(e[k]) / sigma
        total += 0.5 * z * z if z <= HUBER else HUBER * (z - 0.5 * HUBER)
    return total


@njit(cache=True, nogil=True)
def weigh(
    e: NDArray[np.float64],
    slopes: NDArray[np.float64],
    first: int,
    sigma: float,
    gradient: NDArray[np.float64],
    information: NDArray[np.float64],
) -> None:
    """Gradient (m,) and Gauss-Newton information (m, m) of `robust_cost`."""
    gradient[:] = 0.0
    information[:, :] = 0.0
    for k in range(first, e.shape[0]):
        z = e[k] / sigma
        weight = 1.0 if math.fabs(z) <= HUBER else HUBER / math.fabs(z)
        scale = weight / (sigma * sigma)
        for i in range(PARAMETERS):
            gradient[i] += scale * e[k] * slopes[k, i]
            for j in range(i + 1):
                information[i, j] += scale * slopes[k, i] * slopes[k, j]
    for i in range(PARAMETERS):
        for j in range(i):
            information[j, i] = information[i, j]


class PredictionError:
    """J(theta) = robust sum of (e~/sigma)^2 / 2 over one event + (theta - m)' P^-1 (theta - m) / 2.

    Innovations of the first `burn_in` samples do not count: x~ started from another theta.
    """

    def __init__(
        self,
        window: Window,
        setting: Setting,
        innovation_sigma: float,
        prior: Belief,
        bounds: NDArray[np.float64],
        burn_in: int,
    ) -> None:
        """bounds: (m,), |theta| beyond them is inadmissible; raises LinAlgError for a singular prior."""
        self._window = window
        self._setting = setting
        self._sigma = innovation_sigma
        self._mean = prior.mean
        self._prior_information = prior.information()
        self._bounds = bounds
        self._burn_in = burn_in
        samples = window.output.shape[0]
        self._innovations = np.zeros(samples)
        self._slopes = np.zeros((samples, PARAMETERS))
        self._gradient = np.zeros(PARAMETERS)
        self._data_information = np.zeros((PARAMETERS, PARAMETERS))

    @property
    def information(self) -> NDArray[np.float64]:
        """Gauss-Newton information (m, m), prior included, where the gradient was last computed."""
        return self._data_information + self._prior_information

    def value(self, theta: NDArray[np.float64]) -> float:
        """J(theta); inf outside the bounds or where the prediction is not finite."""
        if np.any(np.abs(theta) > self._bounds):
            return math.inf
        innovations(self._window, self._setting, network_of(theta), self._offset(theta), self._innovations)
        return self._cost(theta)

    def value_and_gradient(self, theta: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """J(theta) and its gradient (m,)."""
        innovations_with_sensitivity(
            self._window,
            self._setting,
            network_of(theta),
            self._offset(theta),
            self._innovations,
            self._slopes,
        )
        weigh(
            self._innovations,
            self._slopes,
            self._burn_in,
            self._sigma,
            self._gradient,
            self._data_information,
        )
        return self._cost(theta), self._gradient + self._prior_information @ (theta - self._mean)

    def _cost(self, theta: NDArray[np.float64]) -> float:
        distance = theta - self._mean
        prior_cost = 0.5 * float(distance @ self._prior_information @ distance)
        cost = robust_cost(self._innovations, self._burn_in, self._sigma) + prior_cost
        return cost if math.isfinite(cost) else math.inf

    @staticmethod
    def _offset(theta: NDArray[np.float64]) -> float:
        return float(theta[Parameter.LINE_PRESSURE_OFFSET])
