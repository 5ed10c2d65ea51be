"""Derivatives of the state by a parameter vector theta, and by the state at a start, as they are carried along."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.model import COLUMNS
from observer_rt.model.effective import Coefficients
from observer_rt.model.line.interface import Slopes, no_slopes
from observer_rt.model.network import Network


class ByTheta(NamedTuple):
    """Action of a parameter vector theta: the columns of the network's parameters, the slopes of the line's.

    line_slopes: d(coefficient)/d(theta) of every pair (line_coefficients, line_columns) that is not 0, all (k,);
    those of a column follow each other.
    """

    nozzle_bias: int
    nozzle_weight: int
    seat_bias: int
    nozzle: NDArray[np.int64]  # (NOZZLE_NUMBERS,)
    valve: NDArray[np.int64]  # (VALVE_NUMBERS,)
    valve_sizes: NDArray[np.float64]  # of theta = 1
    line_columns: NDArray[np.int64]
    line_coefficients: NDArray[np.int64]
    line_slopes: NDArray[np.float64]


class Tangent(NamedTuple):
    """Derivatives carried with a state: `by` (n, m), of n states by m numbers, theta first; the rest is scratch.

    Columns beyond those of theta are those of a change of the state: dx/dx(start), if the unit matrix at the start.
    m fills vectors: the last columns may be of nothing.
    """

    by: NDArray[np.float64]
    moved: NDArray[np.float64]  # (n, m)
    by_state: NDArray[np.float64]  # (4, n, n), of x' by x at the stages of a step
    by_number: NDArray[np.float64]  # (4, n, m), of x' by the numbers, x held
    slopes: Slopes
    sigmas: NDArray[np.float64]  # (q,)
    theta: ByTheta


def tangent_of(c: Coefficients, network: Network, theta: ByTheta, columns: int) -> Tangent:
    """A tangent of 0, at least so many columns wide."""
    n, m = c.states, -(-columns // COLUMNS) * COLUMNS
    return Tangent(
        np.zeros((n, m)),
        np.zeros((n, m)),
        np.zeros((4, n, n)),
        np.zeros((4, n, m)),
        no_slopes(c.line),
        np.zeros(network.hidden.shape[0]),
        theta,
    )
