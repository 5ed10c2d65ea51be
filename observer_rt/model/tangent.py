"""Derivatives of the state by a parameter vector theta and by an earlier state, as the core carries them along."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.model import BY_LINE, BY_NOZZLE, BY_SEAT, COLUMNS, FIRST_OF_SEAT
from observer_rt.foundation.units import Floats, Ints
from observer_rt.model.effective import Coefficients


class ByTheta(NamedTuple):
    """Action of a parameter vector theta on the model: its columns by what they act on, and slopes of the line."""

    nozzle_bias: int
    nozzle_weight: int
    seat_bias: int
    seat_weight: int
    neurons: Ints  # (CURVES,), of every curve
    basis: Floats  # (CURVES, PIECES, 4, MOST_NEURONS), of the neurons
    nozzle: Ints  # (NOZZLE_NUMBERS,)
    valve: Ints  # (VALVE_NUMBERS,)
    valve_sizes: Floats  # of theta = 1
    needle: Ints  # (NEEDLE_NUMBERS,)
    needle_sizes: Floats
    shots: int  # commands of an event, with two columns of delays each
    first_shot: int  # the first of these columns
    sensor: Ints  # (SENSOR_NUMBERS,)
    offset: int  # of the line-pressure sensor
    line_columns: Ints  # (k,) of theta, those of a column one after another
    line_coefficients: Ints  # (k,)
    line_slopes: Floats  # (k,) d(coefficient)/d(theta) of these pairs, all that are not 0
    elsewhere: int  # a column behind all others, for numbers that are not wanted


class Tangent(NamedTuple):
    """Derivatives carried with a state: `by` (n, m), of n states by m numbers, theta first; the rest is scratch.

    Columns behind those of theta hold the derivatives by the state at the start, if they begin as the unit matrix. m
    is a multiple of COLUMNS, so that the last columns may be unused.
    """

    by: Floats
    moved: Floats  # (n, m)
    by_state: Floats  # (4, n, COLUMNS), of x' by x at the stages of a lump's step
    by_number: Floats  # (4, n, m), of x' by the numbers of line and valve, x held
    by_flow: Floats  # (4, n, 2), of x' by q_H, q_S
    of_flows: Floats  # (4, 2, m), of q_H, q_S by the numbers of phi, x held
    parts: NDArray[np.uint8]  # (m / COLUMNS,) bits BY_... of what the numbers of COLUMNS columns act on
    by_coefficient: Floats  # (n, k), of x' by the k coefficients of the line
    theta: ByTheta


def tangent_of(c: Coefficients, theta: ByTheta, columns: int, is_commanded: bool = False) -> Tangent:
    """A tangent of 0 with at least so many columns; is_commanded: the seat area follows from commands."""
    n, m = c.states, -(-columns // COLUMNS) * COLUMNS
    of_nozzle, of_seat = theta.neurons[:FIRST_OF_SEAT].sum(), theta.neurons[FIRST_OF_SEAT:].sum()
    nozzle = (theta.nozzle_bias, *theta.nozzle, *range(theta.nozzle_weight, theta.nozzle_weight + of_nozzle))
    seat = (theta.seat_bias, *range(theta.seat_weight, theta.seat_weight + of_seat))
    parts = np.zeros(m, np.uint8)
    by_part = {BY_NOZZLE: nozzle, BY_SEAT: seat, BY_LINE: (*theta.line_columns, *theta.valve)}
    if is_commanded:
        by_part[BY_NOZZLE | BY_SEAT] = *theta.needle, *range(theta.first_shot, theta.first_shot + 2 * theta.shots)
    for part, acting in by_part.items():
        parts[list(acting)] |= part
    by, moved, by_number = (np.zeros(shape) for shape in ((n, m), (n, m), (4, n, m)))
    by_state, by_flow, of_flows = (np.zeros(shape) for shape in ((4, n, COLUMNS), (4, n, 2), (4, 2, m)))
    by_group = np.bitwise_or.reduce(parts.reshape(-1, COLUMNS), axis=1)
    by_coefficient = np.zeros((n, len(c.line._fields)))
    return Tangent(by, moved, by_state, by_number, by_flow, of_flows, by_group, by_coefficient, theta)
