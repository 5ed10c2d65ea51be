"""One sample of the pair: identification system x~ and observer x^."""

import math

from numba import njit

from observer_rt.estimation.predictor import correct
from observer_rt.model.coefficients import Coefficients, LineTerms, with_line_terms
from observer_rt.model.integrator import advance_over
from observer_rt.model.network import Network
from observer_rt.model.sensor import lagged, recorded
from observer_rt.observer.stream.front_end import known
from observer_rt.observer.stream.phi import advance_x_hat, read_phi
from observer_rt.observer.stream.state import RING, Observer

_MASK = RING - 1


@njit(cache=True, nogil=True)
def network_in_force(observer: Observer) -> Network:
    """The network whose weights lie in the observer's memory."""
    memory = observer.memory[0]
    return Network(memory.hidden, memory.output, memory.bias, memory.back_pressure)


@njit(cache=True, nogil=True)
def coefficients_in_force(observer: Observer) -> Coefficients:
    """The model's coefficients with the line terms in the observer's memory."""
    memory = observer.memory[0]
    c: Coefficients = with_line_terms(
        observer.constants.coefficients,
        LineTerms(memory.friction, memory.leakage, memory.stiffness, memory.air),
    )
    return c


@njit(cache=True, nogil=True)
def start_pair(observer: Observer, position: int) -> None:
    """x~ (and x^ with it) begins anew: p_L = y, Q_L = 0, empty sac."""
    memory = observer.memory[0]
    row = observer.ring[position & _MASK]
    row.x_tilde[0] = row.line_pressure - memory.offset
    row.x_tilde[1] = 0.0
    row.x_tilde[2] = 0.0
    row.indicated = row.x_tilde[0]
    row.x_hat[0] = row.x_tilde[0]
    row.x_hat[1] = 0.0
    row.x_hat[2] = 0.0
    memory.since_start = 0
    memory.closed_since_start = 0


@njit(cache=True, nogil=True)
def _is_measured(observer: Observer, position: int) -> bool:
    """Whether the line pressure that belongs to a sample is in the ring, for it may be recorded late or early."""
    late = observer.constants.sensor.late
    if late == 0:
        return True
    if late > 0:
        return bool(known(observer, position) >= late)
    return bool(position + late >= observer.memory[0].segment_start)


@njit(cache=True, nogil=True)
def step_pair(observer: Observer, position: int) -> bool:
    """Both systems from the previous sample to this one; False when a state is no longer finite.

    With the needle long shut the sac is at chamber pressure and x^ := x~; otherwise x^ runs open loop.
    """
    constants = observer.constants
    memory = observer.memory[0]
    before = observer.ring[(position - 1) & _MASK]
    row = observer.ring[position & _MASK]
    network = network_in_force(observer)
    c = coefficients_in_force(observer)
    u_start = (before.rail_pressure, before.seat_area)
    u_end = (row.rail_pressure, row.seat_area)
    knot = (before.lift_after, before.lift_area)

    x = advance_over(
        (before.x_tilde[0], before.x_tilde[1], before.x_tilde[2]),
        u_start,
        knot,
        u_end,
        constants.interval,
        constants.substeps,
        c,
        network,
    )
    gain = min(memory.since_start, observer.gains.shape[0] - 1)
    indicated = lagged(before.indicated, before.x_tilde[0], x[0], constants.interval, memory.lag)
    innovation = 0.0
    if _is_measured(observer, position):
        y = observer.ring[(position + constants.sensor.late) & _MASK].line_pressure
        innovation = y - memory.offset - recorded(before.indicated, indicated, constants.sensor.fraction)
    row.indicated = indicated + observer.gains[gain, 2] * innovation
    x = correct(x, innovation, observer.gains[gain, 0], observer.gains[gain, 1])
    memory.since_start += 1
    if row.resting:
        x = (x[0], x[1], 0.0)
    row.x_tilde[0], row.x_tilde[1], row.x_tilde[2] = x

    if not row.resting:
        x = (before.x_hat[0], before.x_hat[1], before.x_hat[2])
        interval, substeps = constants.interval, constants.substeps
        x = advance_x_hat(observer.phi, x, u_start, knot, u_end, interval, substeps, c, network)
    row.x_hat[0], row.x_hat[1], row.x_hat[2] = x
    return math.isfinite(x[0] + x[1] + x[2] + row.x_tilde[0] + row.x_tilde[1] + row.x_tilde[2])


@njit(cache=True, nogil=True)
def read_out(observer: Observer, position: int) -> None:
    """Injection rate and phi of x^ at a sample, into its row."""
    row = observer.ring[position & _MASK]
    c = coefficients_in_force(observer)
    network = network_in_force(observer)
    x = (row.x_hat[0], row.x_hat[1], row.x_hat[2])
    u = (row.rail_pressure, max(row.seat_area, 0.0))
    phi, row.injection_rate = read_phi(observer.phi, x, u, row.resting, c, network)
    row.phi[0], row.phi[1], row.phi[2] = phi
