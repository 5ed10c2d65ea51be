"""Classical Runge-Kutta of fourth order, once for every system; and the injector over a sample interval.

What a step calls is inlined: passing coefficients and weights by value would cost more than the arithmetic.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import NDArray

import observer_rt.model.leapfrog  # noqa: F401 (makes known how a line of cells is stepped)
from observer_rt.foundation.compiled import inlined, inner, inner_separate
from observer_rt.foundation.small_arrays import WIDTH, load, store
from observer_rt.model.effective import Coefficients
from observer_rt.model.hydraulics import empty_if_drained
from observer_rt.model.line.interface import line_fastest, own_step
from observer_rt.model.network import Network
from observer_rt.model.right_hand_side import is_at_rest, right_hand_side, tangent_rates

LINE_STEP = (
    0.1  # radians of the line's fastest motion an RK4 step may span while nothing flows through the needle
)


@inlined
def between(u_start: tuple[float, float], u_end: tuple[float, float], share: float) -> tuple[float, float]:
    """Inputs at a share (0..1) of the way between two samples.

    A negative area is a shut seat: a sample at which the needle is shut may carry the negative area from which, or
    to which, the ramp leads, so that the seat opens and shuts between the samples where the needle does.
    """
    area = u_start[1] + share * (u_end[1] - u_start[1])
    return u_start[0] + share * (u_end[0] - u_start[0]), max(area, 0.0)


def _along(x: Any, step: float, rate: Any) -> Any:
    """x + step * rate, of tuples."""


@overload(_along, strict=False)
def _along_compiled(x: Any, step: Any, rate: Any) -> Any:
    if len(x) == 1:
        return lambda x, step, rate: (x[0] + step * rate[0],)
    return lambda x, step, rate: (x[0] + step * rate[0],) + _along(x[1:], step, rate[1:])  # noqa: RUF005


@inlined
def runge_kutta_step(
    rates: Callable[..., Any],
    x: Any,
    u_start: Any,
    u_mid: Any,
    u_end: Any,
    step: float,
    system: Any,
    tangent: Any,
) -> Any:
    """One RK4 step [s] of x' = rates(x, u, system, tangent, stage) with the inputs at its start, middle and end.

    x: a tuple of any length. tangent: None, or the `Tangent` that moves with it: `rates` then leaves in it the
    derivatives of x' at every stage.
    """
    total = rate = before = _along(x, -1.0, x)  # 0
    for stage in range(4):  # a loop, so that what works out the rates is compiled once
        u = u_start if stage == 0 else (u_end if stage == 3 else u_mid)
        rate = rates(_along(x, _along_the_step(stage) * step, rate), u, system, tangent, stage)
        total = _with_stage(total, before, rate, stage)
        before = rate
    if tangent is not None:
        _move_tangent(x, step, tangent.by, Linearised(tangent.by_state, tangent.by_number))
    return _along(x, step / 6.0, total)


@inlined
def _along_the_step(stage: int) -> float:
    """Where a stage's rates are taken, as a share of the step, along those of the stage before."""
    return 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)


@inlined
def _with_stage(total: Any, before: Any, rate: Any, stage: int) -> Any:
    """k1 + 2 (k2 + k3) + k4, of tuples, as far as a stage: 0, 1, 2, 3; before: the rates of the one before it."""
    if stage == 1:
        return total  # with the next
    if stage == 2:
        return _along(total, 2.0, _along(before, 1.0, rate))
    return _along(total, 1.0, rate)


class Linearised(NamedTuple):
    """The derivatives of rates at the stages of a step, as in `Tangent`."""

    by_state: NDArray[np.float64]
    by_number: NDArray[np.float64]


@inner
def _move_tangent(x: Any, step: float, by: NDArray[np.float64], linearised: Linearised) -> None:
    """The derivatives by (n, m) over a step [s]: the derivative of an RK4 step is the RK4 step of the derivatives.

    x: a tuple of n.
    """
    for first in range(0, by.shape[1], WIDTH):
        columns = _columns(by, 0, first, x)
        total = rate = before = _along(columns, -1.0, columns)
        for stage in range(4):
            there = _along(columns, _along_the_step(stage) * step, rate)
            rate = _linear_rates(there, linearised, stage, 0, first, x)
            total = _with_stage(total, before, rate, stage)
            before = rate
        _store_columns(_along(columns, step / 6.0, total), by, 0, first)


def _columns(by: NDArray[np.float64], row: int, first: int, x: Any) -> Any:
    """A vector of every row of by (n, m), from `row` on, as a tuple as long as x."""


@overload(_columns, strict=False)
def _columns_compiled(by: Any, row: Any, first: Any, x: Any) -> Any:
    if len(x) == 1:
        return lambda by, row, first, x: (load(by, row * by.shape[1] + first),)
    return lambda by, row, first, x: (
        (load(by, row * by.shape[1] + first),) + _columns(by, row + 1, first, x[1:])  # noqa: RUF005
    )


def _store_columns(columns: Any, by: NDArray[np.float64], row: int, first: int) -> None:
    """The tuple of vectors into the rows of by (n, m), from `row` on."""


@overload(_store_columns, strict=False)
def _store_columns_compiled(columns: Any, by: Any, row: Any, first: Any) -> Any:
    def keep(columns: Any, by: Any, row: Any, first: Any) -> None:
        store(by, row * by.shape[1] + first, columns[0])
        _store_columns(columns[1:], by, row + 1, first)

    return keep if len(columns) else lambda columns, by, row, first: None


def _linear_rates(columns: Any, linearised: Linearised, stage: int, row: int, first: int, rows: Any) -> Any:
    """The rates of change of a tuple of vectors at a stage, from `row` on; rows: a tuple of as many as there are."""


@overload(_linear_rates, strict=False)
def _linear_rates_compiled(columns: Any, linearised: Any, stage: Any, row: Any, first: Any, rows: Any) -> Any:
    def one(columns: Any, linearised: Any, stage: Any, row: Any, first: Any, rows: Any) -> Any:
        by_state, by_number = linearised.by_state, linearised.by_number
        place = (stage * by_number.shape[1] + row) * by_number.shape[2] + first
        along = _combined(by_state[stage, row, 0] * columns[0], columns[1:], by_state, stage, row, 1)
        return (along + load(by_number, place),)

    def all_of_them(columns: Any, linearised: Any, stage: Any, row: Any, first: Any, rows: Any) -> Any:
        return _linear_rates(columns, linearised, stage, row, first, rows[:1]) + _linear_rates(
            columns, linearised, stage, row + 1, first, rows[1:]
        )

    return one if len(rows) == 1 else all_of_them


def _combined(
    total: Any, columns: Any, by_state: NDArray[np.float64], stage: int, row: int, place: int
) -> Any:
    """The total and the vectors times by_state[stage, row, place ..]."""


@overload(_combined, strict=False)
def _combined_compiled(total: Any, columns: Any, by_state: Any, stage: Any, row: Any, place: Any) -> Any:
    def add(total: Any, columns: Any, by_state: Any, stage: Any, row: Any, place: Any) -> Any:
        more = total + by_state[stage, row, place] * columns[0]
        return _combined(more, columns[1:], by_state, stage, row, place + 1)

    return add if len(columns) else lambda total, columns, by_state, stage, row, place: total


@inlined
def integrate(
    rates: Callable[..., Any],
    inputs_at: Callable[..., Any],
    x: NDArray[np.float64],
    u_start: Any,
    u_end: Any,
    interval: float,
    steps: int,
    system: Any,
    tangent: Any,
    line: Any,
) -> None:
    """`steps` RK4 steps over an interval [s], x (n,) in place; inputs_at: as `between`."""
    state = _state(x, line)
    for i in range(steps):
        state = runge_kutta_step(
            rates,
            state,
            inputs_at(u_start, u_end, i / steps),
            inputs_at(u_start, u_end, (i + 0.5) / steps),
            inputs_at(u_start, u_end, (i + 1.0) / steps),
            interval / steps,
            system,
            tangent,
        )
    _store(state, x, 0)


def _state(x: NDArray[np.float64], line: Any) -> Any:
    """The array x (n,) as a tuple."""


def _store(state: Any, x: NDArray[np.float64], first: int) -> None:
    """The tuple into the array x (n,), from place `first` on."""


@overload(_store, strict=False)
def _store_compiled(state: Any, x: Any, first: Any) -> Any:
    def store(state: Any, x: Any, first: Any) -> None:
        x[first] = state[0]
        _store(state[1:], x, first + 1)

    return store if len(state) else lambda state, x, first: None


@overload(_state, strict=False)
def _state_compiled(x: Any, line: Any) -> Any:
    states = 3 + line.instance_class.further
    return lambda x, line: to_fixed_tuple(x, states)


class Interval(NamedTuple):
    """From one sample to the next; inputs u = [p_R, A_S] normalised by (24), linear in between."""

    start: tuple[float, float]  # u
    end: tuple[float, float]
    length: float  # s
    substeps: int  # RK4 steps at most


class System(NamedTuple):
    """The injector as RK4 sees it."""

    coefficients: Coefficients
    network: Network


@inlined
def injector_rates(x: Any, u: tuple[float, float], system: System, tangent: Any, stage: int) -> Any:
    """(25)-(26), with their derivatives where a tangent is carried."""
    if tangent is None:
        return right_hand_side(x, u, system.coefficients, system.network)
    by_state, by_number = tangent.by_state[stage], tangent.by_number[stage]
    return tangent_rates(x, u, system.coefficients, system.network, tangent, by_state, by_number)


@inlined
def _steps_in(x: Any, interval: Interval, c: Coefficients) -> int:
    """RK4 steps an interval needs: `substeps` for the sac, far fewer while only the line moves."""
    if is_at_rest(x, interval.start) and interval.end[1] <= 0.0:
        return min(interval.substeps, math.ceil(interval.length * line_fastest(c.line) / LINE_STEP))
    return interval.substeps


@inner_separate
def runge_kutta(
    x: NDArray[np.float64], interval: Interval, c: Coefficients, network: Network, tangent: Any
) -> None:
    """`advance` without what empties the sac."""
    steps = _steps_in(x, interval, c)
    system, length = System(c, network), interval.length
    integrate(
        injector_rates, between, x, interval.start, interval.end, length, steps, system, tangent, c.line
    )


@inlined
def advance(
    x: NDArray[np.float64], interval: Interval, c: Coefficients, network: Network, tangent: Any
) -> None:
    """State x (n,) one sample interval later, in place; tangent: the `Tangent` that moves with it, None for none."""
    runge_kutta(x, interval, c, network, tangent)
    empty_if_drained(x, interval.start, interval.end, tangent)


@inlined
def advance_over(
    x: NDArray[np.float64],
    interval: Interval,
    knot: tuple[float, float],
    c: Coefficients,
    network: Network,
    tangent: Any,
) -> None:
    """State x (n,) one sample interval later, in place, of any line, where the area may bend at a knot.

    knot: the share (0..1) of the interval it comes after, and the normalised area there; a share of 0 is none. It
    means nothing where the needle is shut all through the interval. tangent: as of `advance`.
    """
    _over(x, interval, knot, c, network, tangent)


def _over(x: Any, interval: Any, knot: Any, c: Any, network: Any, tangent: Any) -> None:
    """The way the line at hand goes over an interval."""


@overload(_over, strict=False, jit_options={"forceinline": True})
def _over_compiled(x: Any, interval: Any, knot: Any, c: Any, network: Any, tangent: Any) -> Any:
    own = own_step(c.types[c.fields.index("line")].instance_class)
    if own is None:
        return _runge_kutta_over.py_func
    over = own.over

    def step(x: Any, interval: Any, knot: Any, c: Any, network: Any, tangent: Any) -> None:
        over(x, interval, knot, c, network, tangent)
        empty_if_drained(x, interval.start, interval.end, tangent)

    return step


@inner
def _runge_kutta_over(
    x: NDArray[np.float64],
    interval: Interval,
    knot: tuple[float, float],
    c: Coefficients,
    network: Network,
    tangent: Any,
) -> None:
    """`advance` up to the knot and from it on."""
    share = knot[0]
    flows = interval.start[1] > 0.0 or knot[1] > 0.0 or interval.end[1] > 0.0
    if 0.0 < share < 1.0 and flows:
        _advance_in_two(x, interval, knot, c, network, tangent)
    else:
        advance(x, interval, c, network, tangent)


@inner
def _advance_in_two(
    x: NDArray[np.float64],
    interval: Interval,
    knot: tuple[float, float],
    c: Coefficients,
    network: Network,
    tangent: Any,
) -> None:
    """`advance` up to a knot, and from it on."""
    start, end, share, rest = interval.start, interval.end, knot[0], 1.0 - knot[0]
    u_knot = (start[0] + share * (end[0] - start[0]), knot[1])
    length, substeps = interval.length, interval.substeps
    advance(x, Interval(start, u_knot, share * length, math.ceil(share * substeps)), c, network, tangent)
    advance(x, Interval(u_knot, end, rest * length, math.ceil(rest * substeps)), c, network, tangent)


def fine_step(
    x: NDArray[np.float64],
    u_start: tuple[float, float],
    u_middle: tuple[float, float],
    u_end: tuple[float, float],
    step: float,
    c: Coefficients,
    network: Network,
) -> None:
    """A single step [s] of any line, in place, its inputs known in its middle too. For compiled code."""
    raise NotImplementedError


@overload(fine_step, strict=False)
def _fine_step_compiled(
    x: Any, u_start: Any, u_middle: Any, u_end: Any, step: Any, c: Any, network: Any
) -> Any:
    def runge_kutta(x: Any, u_start: Any, u_middle: Any, u_end: Any, step: Any, c: Any, network: Any) -> None:
        state, system = _state(x, c.line), System(c, network)
        _store(runge_kutta_step(injector_rates, state, u_start, u_middle, u_end, step, system, None), x, 0)

    own = own_step(c.types[c.fields.index("line")].instance_class)
    return runge_kutta if own is None else own.fine.py_func
