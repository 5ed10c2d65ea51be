"""What steps the pair x~ and x^ from sample to sample: the only part of the stream compiled for a line and a phi."""

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.stream.stream import RING
from observer_rt.estimation.predictor import correct, predict
from observer_rt.foundation.compiled import addressed, inlined, inner, inner_separate
from observer_rt.foundation.referenced import referenced
from observer_rt.foundation.small_arrays import copy_vector
from observer_rt.model.borrowed import borrowed
from observer_rt.model.effective import Coefficients
from observer_rt.model.forcing import (
    Forced,
    Forcing,
    borrowed_forcing,
    is_shut_under_terms,
    shown_under_terms,
    trusted_under_terms,
    under_terms,
)
from observer_rt.model.integrator import Interval
from observer_rt.model.line.interface import line_from, rest_line
from observer_rt.model.network import Network
from observer_rt.model.sensor import Sensor
from observer_rt.observer.stream.phi import Phi, advance_x_hat, put_into, read_phi

_MASK = RING - 1


class Stepping(IntEnum):
    """What is asked of it, at a position of the ring."""

    START = 0  # x~ and x^ anew: p_L = y, Q_L = 0, empty sac
    PREDICT = 1  # x~ from the sample before; returns what the sensor is to record of it
    CORRECT = 2  # x~ by the sample's innovation, then x^; returns nan where a state is no longer finite
    PUT = 3  # phi of a slot of what was posted into force


_START, _PREDICT, _CORRECT = int(Stepping.START), int(Stepping.PREDICT), int(Stepping.CORRECT)


@referenced()
class Stepper(NamedTuple):
    """An observer's model, and its memory as `Observer` has it."""

    coefficients: Coefficients
    sensor: Sensor
    interval: float  # s
    substeps: int
    memory: NDArray[np.void]
    ring: NDArray[np.void]
    x_tilde: NDArray[np.float64]
    x_hat: NDArray[np.float64]
    gains: NDArray[np.float64]
    phi: Phi
    posted: Phi
    of_tilde: Forcing
    of_hat: Forcing


@addressed
def step(stepper: Stepper, what: int, position: int) -> float:
    """One of `Stepping`; 0 where that says nothing of a result.

    After START and CORRECT the sample's row has injection rate and phi of x^.
    """
    if what == _PREDICT:
        return float(_predict(stepper, position))
    if what == _CORRECT:
        return float(_correct(stepper, position))
    if what == _START:
        _start(stepper, position)
    else:
        put_into(stepper.phi, stepper.posted, position)
    return 0.0


@inner
def network_in_force(stepper: Stepper) -> Network:
    """The network whose weights lie in the observer's memory."""
    memory = stepper.memory[0]
    return Network(
        borrowed(memory.hidden),
        borrowed(memory.output),
        borrowed(memory.bias),
        borrowed(memory.back_pressure),
    )


@inner
def coefficients_in_force(stepper: Stepper) -> Coefficients:
    """The model's coefficients with the line terms in the observer's memory."""
    c = stepper.coefficients
    return Coefficients(
        line_from(stepper.memory[0].line, c.line),
        c.seat,
        c.nozzle,
        c.sac,
        c.pressure_scale,
        c.flow_scale,
        c.area_scale,
        c.chamber_pressure,
        c.density,
        c.compression,
    )


@inner
def _start(stepper: Stepper, position: int) -> None:
    row = stepper.ring[position & _MASK]
    x_tilde, x_hat = stepper.x_tilde[position & _MASK], borrowed(stepper.x_hat[position & _MASK])
    rest_line(x_tilde, row.line_pressure - stepper.memory[0].offset, stepper.coefficients.line)
    x_tilde[2] = 0.0
    copy_vector(x_tilde, x_hat)
    stepper.of_tilde.memory[:] = math.nan
    _read(stepper, position, x_hat, coefficients_in_force(stepper), network_in_force(stepper))


@inlined
def _as_given(stepper: Stepper, position: int) -> Forced:
    """The interval before a sample, in which the area may bend, and the model without terms."""
    before, row = stepper.ring[(position - 1) & _MASK], stepper.ring[position & _MASK]
    interval = Interval(
        (before.rail_pressure, before.seat_area),
        (row.rail_pressure, row.seat_area),
        stepper.interval,
        stepper.substeps,
    )
    knot = (before.lift_after, before.lift_area)
    return Forced(interval, knot, coefficients_in_force(stepper), network_in_force(stepper))


@inner
def _under_terms(stepper: Stepper, position: int, x: NDArray[np.float64], forcing: Forcing) -> Forced:
    """The same from a state x (n,) on with the terms in force.

    Apart from it: to choose between the two by value would cost more than a term does.
    """
    given = _as_given(stepper, position)
    forced: Forced = under_terms(
        x, given.interval, given.knot, given.coefficients, given.network, borrowed_forcing(forcing)
    )
    return forced


@inner_separate
def _predict(stepper: Stepper, position: int) -> float:
    before, row = (position - 1) & _MASK, position & _MASK
    x_tilde = borrowed(stepper.x_tilde[row])  # as learning has it: one code for both
    copy_vector(stepper.x_tilde[before], x_tilde)
    indicated, fraction, lag = stepper.ring[before].indicated, stepper.sensor.fraction, stepper.memory[0].lag
    if stepper.of_tilde.program.shape[0] == 0:
        indicated, shown = predict(x_tilde, indicated, _as_given(stepper, position), fraction, lag, None)
    else:
        forced = _under_terms(stepper, position, x_tilde, stepper.of_tilde)
        indicated, shown = predict(x_tilde, indicated, forced, fraction, lag, None)
        shown = shown_under_terms(shown, forced, borrowed_forcing(stepper.of_tilde))
    stepper.ring[row].indicated = indicated
    return float(shown)


@inner_separate
def _correct(stepper: Stepper, position: int) -> float:
    """With the needle long shut x^ := x~, the sac at chamber pressure but for a term; else x^ runs open loop."""
    row = stepper.ring[position & _MASK]
    x_tilde, x_hat = borrowed(stepper.x_tilde[position & _MASK]), borrowed(stepper.x_hat[position & _MASK])
    gain = stepper.gains[min(stepper.memory[0].since_start, stepper.gains.shape[0] - 1)]
    trusted = row.innovation
    if stepper.of_tilde.program.shape[0] > 0:
        trusted = trusted_under_terms(trusted, stepper.interval, borrowed_forcing(stepper.of_tilde))
    row.indicated = correct(x_tilde, row.indicated, trusted, gain, None)
    if row.resting:
        if is_shut_under_terms(stepper.of_tilde):
            x_tilde[2] = 0.0
        copy_vector(x_tilde, x_hat)
        copy_vector(stepper.of_tilde.past, stepper.of_hat.past)
        copy_vector(stepper.of_tilde.memory, stepper.of_hat.memory)
        _read(stepper, position, x_hat, coefficients_in_force(stepper), network_in_force(stepper))
    else:
        copy_vector(stepper.x_hat[(position - 1) & _MASK], x_hat)
        if stepper.of_hat.program.shape[0] == 0:
            _move_x_hat(stepper, position, x_hat, _as_given(stepper, position))
        else:
            _move_x_hat(stepper, position, x_hat, _under_terms(stepper, position, x_hat, stepper.of_hat))
    return 0.0 if math.isfinite(x_hat.sum() + x_tilde.sum()) else math.nan


@inlined
def _move_x_hat(stepper: Stepper, position: int, x_hat: NDArray[np.float64], forced: Forced) -> None:
    c, network = forced.coefficients, forced.network
    advance_x_hat(stepper.phi, x_hat, forced.interval, forced.knot, c, network)
    _read(stepper, position, x_hat, c, network)


@inner
def _read(
    stepper: Stepper, position: int, x_hat: NDArray[np.float64], c: Coefficients, network: Network
) -> None:
    """Injection rate and phi of x^ into a sample's row; both are 0 at rest with an empty sac."""
    row = stepper.ring[position & _MASK]
    phi, rate = (0.0, 0.0, 0.0), 0.0
    if not row.resting or x_hat[2] != 0.0:  # a term may hold the needle open
        u = (row.rail_pressure, max(row.seat_area, 0.0))
        phi, rate = read_phi(stepper.phi, x_hat, u, c, network)
    row.phi[0], row.phi[1], row.phi[2] = phi
    row.injection_rate = rate
