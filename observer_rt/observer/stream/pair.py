"""One sample of the pair: identification system x~ and observer x^."""

import math

from observer_rt.estimation.predictor import correct, predict
from observer_rt.foundation.compiled import inner, inner_separate
from observer_rt.foundation.small_arrays import copy_vector
from observer_rt.foundation.units import MEGAPASCAL
from observer_rt.model.borrowed import borrowed
from observer_rt.model.coefficients import Coefficients
from observer_rt.model.integrator import Interval
from observer_rt.model.line.interface import line_from, rest_line
from observer_rt.model.network import Network
from observer_rt.observer.stream.front_end import known
from observer_rt.observer.stream.outliers import accepted
from observer_rt.observer.stream.phi import advance_x_hat, read_phi
from observer_rt.observer.stream.state import LINE, RING, Observer
from observer_rt.observer.stream.surprise import end_contradiction, watch

SHORT = (
    2  # times what an opening takes to be one: leaps of the innovation that last longer contradict the model
)
# s of standstill in which the offset of x~ follows its innovations: some samples of a rail pressure of 1 kHz
OFFSET_FOLLOWS = 5e-3
FURTHEST_OFFSET = 1.5 * MEGAPASCAL  # from the learned one: what moves further is no offset of a good sensor
_MASK = RING - 1


@inner
def network_in_force(observer: Observer) -> Network:
    """The network whose weights lie in the observer's memory."""
    memory = observer.memory[0]
    return Network(
        borrowed(memory.hidden),
        borrowed(memory.output),
        borrowed(memory.bias),
        borrowed(memory.back_pressure),
    )


@inner
def coefficients_in_force(observer: Observer) -> Coefficients:
    """The model's coefficients with the line terms in the observer's memory."""
    memory = observer.memory[0]
    c = observer.constants.coefficients
    return Coefficients(
        line_from(memory.line, c.line),
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
def start_pair(observer: Observer, position: int) -> None:
    """x~ (and x^ with it) begins anew: p_L = y, Q_L = 0, empty sac."""
    memory = observer.memory[0]
    row = observer.ring[position & _MASK]
    memory.offset = memory.learned_offset
    pressure = row.line_pressure - memory.offset
    rest_line(row.x_tilde, pressure, observer.constants.coefficients.line)
    row.x_tilde[2] = 0.0
    row.indicated = pressure
    row.innovation = 0.0
    memory.accepted_innovation = 0.0
    memory.surprise = 0.0
    copy_vector(row.x_tilde, row.x_hat)
    memory.since_start = 0
    memory.closed_since_start = 0


@inner
def _is_measured(observer: Observer, position: int) -> bool:
    """Whether the line pressure that belongs to a sample is in the ring, for it may be recorded late or early.

    And is one: an outlier is none.
    """
    late = observer.constants.sensor.late
    if (observer.ring[(position + late) & _MASK].bridged >> LINE) & 1:
        return False
    if late == 0:
        return True
    if late > 0:
        return bool(known(observer, position) >= late)
    return bool(position + late >= observer.memory[0].segment_start)


@inner_separate
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
    interval = Interval(
        (before.rail_pressure, before.seat_area),
        (row.rail_pressure, row.seat_area),
        constants.interval,
        constants.substeps,
    )
    knot = (before.lift_after, before.lift_area)

    x_tilde, x_hat = borrowed(row.x_tilde), borrowed(row.x_hat)  # as learning has them: one code for both
    copy_vector(before.x_tilde, x_tilde)
    fraction = constants.sensor.fraction
    indicated, shown = predict(
        x_tilde, before.indicated, interval, knot, fraction, memory.lag, c, network, None
    )
    row.innovation = 0.0
    if _is_measured(observer, position):
        y = observer.ring[(position + constants.sensor.late) & _MASK].line_pressure
        innovation = y - memory.offset - shown
        if accepted(memory, min(constants.timing.bridge, SHORT * constants.timing.confirm), innovation):
            row.innovation = innovation
            was_contradicted = memory.contradicted
            watch(observer, innovation, row.doubt)
            if memory.contradicted:
                end_contradiction(observer, row.resting, not was_contradicted)
    gain = observer.gains[min(memory.since_start, observer.gains.shape[0] - 1)]
    row.indicated = correct(x_tilde, indicated, row.innovation, gain, None)
    memory.since_start += 1
    if row.resting:
        _follow_offset(observer, row.innovation)
        x_tilde[2] = 0.0
        copy_vector(x_tilde, x_hat)
    else:
        copy_vector(before.x_hat, x_hat)
        advance_x_hat(observer.phi, x_hat, interval, knot, c, network)
    return math.isfinite(x_hat.sum() + x_tilde.sum())


@inner
def _follow_offset(observer: Observer, innovation: float) -> None:
    """Between events, too, the offset of x~ is what the standstill shows: sensors drift, or their gains differ.

    Not where the noise is coloured: its slow part has a mean at rest that the next opening does not keep.
    """
    memory = observer.memory[0]
    furthest = FURTHEST_OFFSET / observer.constants.coefficients.pressure_scale
    is_settled = memory.since_start > observer.constants.timing.settle
    if not (memory.offset_moves and is_settled and math.isfinite(innovation)):
        return
    moved = memory.offset - memory.learned_offset + innovation * observer.constants.interval / OFFSET_FOLLOWS
    memory.offset = memory.learned_offset + min(max(moved, -furthest), furthest)


@inner
def read_out(observer: Observer, position: int) -> None:
    """Injection rate and phi of x^ at a sample, into its row."""
    row = observer.ring[position & _MASK]
    phi, rate = (0.0, 0.0, 0.0), 0.0
    if not row.resting:
        c = coefficients_in_force(observer)
        u = (row.rail_pressure, max(row.seat_area, 0.0))
        phi, rate = read_phi(observer.phi, borrowed(row.x_hat), u, c, network_in_force(observer))
    row.phi[0], row.phi[1], row.phi[2] = phi
    row.injection_rate = rate
