"""Evaluates the terms in force once a sample, and holds what they change over the interval. Compiled.

A term is a law of the state at the start of an interval and of the inputs in its middle (`model.terms`), one of the
sensor of the pressure at its end. What it changes is what a model has anyway: coefficients of the line, the constants
of the network, the inputs.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled, inlined, inner, inner_separate
from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE, MILLISECOND, MM3_PER_MS
from observer_rt.model.borrowed import borrowed
from observer_rt.model.effective import Coefficients
from observer_rt.model.hydraulics import Seat, normalised_area
from observer_rt.model.integrator import Interval
from observer_rt.model.network import Network
from observer_rt.model.right_hand_side import changed_flows, injection_rate, is_at_rest
from observer_rt.model.terms.program import fresh_memory, reads, run_program, sensor_rows, without_ringing
from observer_rt.model.terms.term import TermEquation
from observer_rt.model.terms.variable import Variable

NO_PROGRAM = np.empty((0, 2))
_LIFT_ITERATIONS = 5  # of a lift whose flow coefficient depends on it
LEAST_LIFT = 0.02e-6  # m, from which on a term holds a needle open that is seen to be shut


class Clock(NamedTuple):
    """What laws may count: time [s] and openings of the needle up to a sample."""

    time: float = 0.0
    injections: float = 0.0


NO_CLOCK = Clock()


class Forcing(NamedTuple):
    """A program of terms, and what is remembered from sample to sample; the rest is scratch."""

    program: NDArray[np.float64]  # (n, 2)
    memory: NDArray[np.float64]  # of `fresh_memory`
    past: NDArray[
        np.float64
    ]  # (8,): time, openings, time since, lift, p_L, area, and two of what laws there are
    variables: NDArray[np.float64]
    totals: NDArray[np.float64]  # by `TermEquation`, in its units
    line: NDArray[np.float64]
    bias: NDArray[np.float64]  # (2,)
    back_pressure: NDArray[np.float64]  # (2,)


_VARIABLES, _TOTALS = len(Variable), len(TermEquation)
_RATES = int(Variable.LIFT_RATE)  # and the two after it
_LINE_PRESSURE, _SENSOR = int(Variable.LINE_PRESSURE), TermEquation.LINE_PRESSURE_SENSOR.number
_SEAT_FLOW, _NOZZLE_FLOW, _OPEN = int(Variable.SEAT_FLOW), int(Variable.NOZZLE_FLOW), int(Variable.OPEN)
_TIME, _INJECTIONS, _SINCE, _LIFT, _PRESSURE, _AREA = range(6)  # of `Forcing.past`: s, -, ms, mm, MPa, -
_OF_FLOWS, _OF_SENSOR = 6, 7  # whether a law reads the flow through seat or nozzle, or is of the sensor


@compiled
def forcing_of(program: NDArray[np.float64], clock: Clock, of_line: int) -> Forcing:
    """A program about to begin, the needle shut; of_line: coefficients of the line."""
    past = np.zeros(8)
    past[_OF_SENSOR] = sensor_rows(program) < program.shape[0]
    past[_OF_FLOWS] = reads(program, _SEAT_FLOW) or reads(program, _NOZZLE_FLOW)
    past[_TIME], past[_INJECTIONS], past[_PRESSURE] = clock.time, clock.injections, math.nan
    return Forcing(
        program,
        fresh_memory(program),
        past,
        np.zeros(_VARIABLES),
        np.zeros(_TOTALS),
        np.zeros(of_line),
        np.zeros(2),
        np.zeros(2),
    )


@inner
def borrowed_forcing(forcing: Forcing) -> Forcing:
    """A forcing of borrowed arrays."""
    return Forcing(
        borrowed(forcing.program),
        borrowed(forcing.memory),
        borrowed(forcing.past),
        borrowed(forcing.variables),
        borrowed(forcing.totals),
        borrowed(forcing.line),
        borrowed(forcing.bias),
        borrowed(forcing.back_pressure),
    )


class Forced(NamedTuple):
    """A sample interval under terms: inputs, model and network."""

    interval: Interval
    knot: tuple[float, float]
    coefficients: Coefficients
    network: Network


@inlined
def under_terms(
    x: NDArray[np.float64],
    interval: Interval,
    knot: tuple[float, float],
    c: Coefficients,
    network: Network,
    forcing: Forcing,
) -> Forced:
    """The interval from a state x (n,) on as the terms in force change it; as it is where there are none."""
    if forcing.program.shape[0] == 0:
        return Forced(interval, knot, c, network)
    changed: Forced = _forced(x, interval, knot, c, network, forcing)
    return changed


@inlined
def rate_after(x: NDArray[np.float64], forced: Forced) -> float:
    """The injection rate [m3/s] at the end of an interval under terms, x (n,) being the state there."""
    u = (forced.interval.end[0], max(forced.interval.end[1], 0.0))
    return float(injection_rate(x, u, forced.coefficients, forced.network))


@inner_separate
def _forced(
    x: NDArray[np.float64],
    interval: Interval,
    knot: tuple[float, float],
    c: Coefficients,
    network: Network,
    forcing: Forcing,
) -> Forced:
    _observe(x, interval, c, network, forcing)
    _run(forcing, 0, sensor_rows(forcing.program), interval.length)
    totals = to_fixed_tuple(forcing.totals, _TOTALS)  # in the order of `TermEquation`
    loss, outflow, seat, nozzle, stiffness, inertance, chamber, _, lift, rail = totals
    pressure, flow = MEGAPASCAL / c.pressure_scale, MM3_PER_MS / c.flow_scale
    forcing.bias[0] = network.bias[0] + nozzle
    forcing.bias[1] = network.bias[1] + seat
    forcing.back_pressure[0] = network.back_pressure[0] + chamber * pressure
    forcing.back_pressure[1] = network.back_pressure[1]
    line = _line_under(c.line, forcing.line, stiffness, inertance, outflow * flow, loss * pressure)
    more, lift = rail * pressure, lift * MILLIMETRE
    moves = forcing.variables[_OPEN] > 0.0
    area = lifted(interval.end[1], lift, moves, c.seat)
    forcing.past[_AREA] = area
    bends = interval.start[1] > 0.0 or knot[1] > 0.0 or interval.end[1] > 0.0
    return Forced(
        Interval(
            (interval.start[0] + more, lifted(interval.start[1], lift, moves, c.seat)),
            (interval.end[0] + more, area),
            interval.length,
            interval.substeps,
        ),
        (knot[0] if bends else 0.0, lifted(knot[1], lift, moves, c.seat)),
        Coefficients(
            line,
            c.seat,
            c.nozzle,
            c.sac,
            c.pressure_scale,
            c.flow_scale,
            c.area_scale,
            c.chamber_pressure,
            c.density,
            c.compression,
        ),
        Network(network.hidden, network.output, forcing.bias, forcing.back_pressure),
    )


@inner
def _run(forcing: Forcing, first: int, end: int, duration: float) -> None:
    """The rows of the program from one up to another, over a time [s]."""
    rows, milliseconds = (first, end), duration / MILLISECOND
    run_program(forcing.program, rows, forcing.variables, forcing.memory, milliseconds, forcing.totals)


@inlined
def shown_under_terms(shown: float, forced: Forced, forcing: Forcing) -> float:
    """What is recorded at the end of an interval of a line pressure that the sensor would show, in units of p_0.

    Terms of the sensor see that pressure: for what rings it must not be late.
    """
    return _shown(shown, forced, forcing) if forcing.past[_OF_SENSOR] > 0.0 else shown


@inner_separate
def _shown(shown: float, forced: Forced, forcing: Forcing) -> float:
    first, end = sensor_rows(forcing.program), forcing.program.shape[0]
    c, duration, variables = forced.coefficients, forced.interval.length, forcing.variables
    line_pressure = (shown * c.pressure_scale + c.chamber_pressure) / MEGAPASCAL
    variables[_LINE_PRESSURE] = line_pressure
    if duration > 0.0:
        variables[_RATES + 2] = (line_pressure - forcing.past[_PRESSURE]) * MILLISECOND / duration
    _run(forcing, first, end, duration)
    return float(shown + forcing.totals[_SENSOR] * MEGAPASCAL / c.pressure_scale)


@inlined
def is_shut_under_terms(forcing: Forcing) -> bool:
    """Whether no term held the needle open at the end of the last interval."""
    return bool(forcing.past[_AREA] <= 0.0)


@inlined
def trusted_under_terms(innovation: float, interval: float, forcing: Forcing) -> float:
    """An innovation as the state is corrected by it, an interval [s] after the last: without what the sensor rings.

    With it the gain would feed the resonance.
    """
    return _trusted(innovation, interval, forcing) if forcing.past[_OF_SENSOR] > 0.0 else innovation


@inner_separate
def _trusted(innovation: float, interval: float, forcing: Forcing) -> float:
    return float(without_ringing(forcing.program, forcing.memory, innovation, interval / MILLISECOND))


@inner
def _observe(
    x: NDArray[np.float64], interval: Interval, c: Coefficients, network: Network, forcing: Forcing
) -> None:
    """The variables of laws, in printed units, by the state at the start of an interval and the inputs in its middle.

    One of no length is an instant: what changes with time stays.
    """
    past, variables, duration = forcing.past, forcing.variables, interval.length / MILLISECOND
    rail = 0.5 * (interval.start[0] + interval.end[0])
    area = 0.5 * (max(interval.start[1], 0.0) + max(interval.end[1], 0.0))
    is_open = area > 0.0
    lift = lift_at(area, c.seat) / MILLIMETRE
    if is_open and past[_LIFT] <= 0.0:
        past[_INJECTIONS] += 1.0
        past[_SINCE] = 0.0
    q_h, q_s = 0.0, 0.0
    state, u = (x[0], x[1], x[2]), (rail, area)
    if past[_OF_FLOWS] > 0.0 and not is_at_rest(state, u):
        q_h, q_s = changed_flows(state, u, c, network)
    unit = c.pressure_scale / MEGAPASCAL
    chamber = c.chamber_pressure / MEGAPASCAL
    line_pressure = x[0] * unit + chamber
    lift_rate, rail_rate, line_rate = variables[_RATES], variables[_RATES + 1], variables[_RATES + 2]
    if duration > 0.0:
        lift_rate = (lift - past[_LIFT]) / duration
        rail_rate = (interval.end[0] - interval.start[0]) * unit / duration
        rise = line_pressure - past[_PRESSURE]
        line_rate = 0.0 if math.isnan(rise) else rise / duration
        past[_LIFT], past[_PRESSURE] = lift, line_pressure
    through_nozzle = c.nozzle.flow / MM3_PER_MS
    seen = (  # in the order of `Variable`
        rail * unit + chamber,
        line_pressure,
        x[2] * unit + chamber,
        chamber,
        x[1] * c.flow_scale / MM3_PER_MS,
        q_s * through_nozzle * c.sac.a5 / c.sac.a6,
        q_h * through_nozzle,
        lift,
        math.nan,  # the largest lift, a number in every program
        lift_rate,
        rail_rate,
        line_rate,
        past[_SINCE],
        past[_TIME],
        max(past[_INJECTIONS], 1.0),
        1.0 if is_open else 0.0,
        0.0 if is_open else 1.0,
        1.0 if is_open and lift_rate > 0.0 else 0.0,
        1.0 if is_open and lift_rate < 0.0 else 0.0,
    )
    for i in range(_VARIABLES):
        variables[i] = seen[i]
    past[_SINCE] += duration
    past[_TIME] += interval.length


@inner
def lift_at(u_2: float, seat: Seat) -> float:
    """The lift x_N [m] that opens a normalised seat area, the inverse of `normalised_area`; 0 for a shut needle."""
    if u_2 <= 0.0:
        return 0.0
    lift: float = _lift_of_area(u_2 * seat.area_scale, seat)
    if seat.loss != 0.0:
        for _ in range(_LIFT_ITERATIONS):
            share = 1.0 - seat.loss * math.exp(-lift / seat.loss_lift)
            lift = _lift_of_area(u_2 * seat.area_scale / share, seat)
    return lift


@inlined
def _lift_of_area(area: float, seat: Seat) -> float:
    bend = math.sin(2.0 * seat.half_cone_angle)
    scaled = area / (math.pi * math.sin(seat.half_cone_angle))
    lift: float = 2.0 * scaled / (seat.diameter + math.sqrt(max(seat.diameter**2 - 2.0 * bend * scaled, 0.0)))
    return lift


@inner
def lifted(u_2: float, lift: float, moves: bool, seat: Seat) -> float:
    """A normalised seat area with so much lift [m] added; a needle seen to be shut may stay so, or be held open.

    moves: whether the needle is on a ramp, of which a negative area is the foot, see `integrator.between`.
    """
    if lift == 0.0:
        return u_2
    measured = lift_at(abs(u_2), seat)
    true = lift + (measured if u_2 > 0.0 else -measured if moves else 0.0)
    if u_2 <= 0.0 and true < LEAST_LIFT:
        return u_2
    area: float = normalised_area(true, seat)
    return area


def _line_under(
    line: Any, values: NDArray[np.float64], stiffness: float, inertance: float, outflow: float, loss: float
) -> Any:
    """The line with stiffness and inertance times 1 + a share, and with an outflow of its end and a loss along it."""
    raise NotImplementedError


@overload(_line_under, strict=False)
def _line_under_compiled(
    line: Any, values: Any, stiffness: Any, inertance: Any, outflow: Any, loss: Any
) -> Any:
    kind, size = line.instance_class, len(line.fields)
    stiff = np.array([float(name in kind.of_stiffness) for name in line.fields])
    inert = np.array([float(name in kind.of_inertance) for name in line.fields])
    out, lost = line.fields.index("outflow"), line.fields.index("loss")

    def change(line: Any, values: Any, stiffness: Any, inertance: Any, outflow: Any, loss: Any) -> Any:
        less = 1.0 / (1.0 + inertance) - 1.0
        for i in range(size):
            values[i] = line[i] * (1.0 + stiffness * stiff[i]) * (1.0 + less * inert[i])
        values[out] = outflow
        values[lost] = loss
        return kind(*to_fixed_tuple(values, size))

    return change
