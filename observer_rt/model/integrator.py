"""Classical Runge-Kutta of fourth order, once for every system; and the injector over a sample interval.

What a step calls is inlined: passing coefficients and weights by value would cost more than the arithmetic.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numba.extending import overload
from numba.np.unsafe.ndarray import to_fixed_tuple
from numpy.typing import NDArray

from observer_rt.model.coefficients import Coefficients
from observer_rt.model.leapfrog import leapfrog, move_end, move_line
from observer_rt.model.line.interface import line_fastest
from observer_rt.model.network import Network
from observer_rt.model.right_hand_side import is_at_rest, right_hand_side, tangent_rates

EMPTY_SAC = 1e-7  # of p_0: a shut, drained sac this close to chamber pressure is at it
LINE_STEP = (
    0.1  # radians of the line's fastest motion an RK4 step may span while nothing flows through the needle
)


@njit(cache=True, nogil=True, inline="always")
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


def _weighted(k1: Any, k2: Any, k3: Any, k4: Any) -> Any:
    """k1 + 2 k2 + 2 k3 + k4, of tuples."""


@overload(_weighted, strict=False)
def _weighted_compiled(k1: Any, k2: Any, k3: Any, k4: Any) -> Any:
    if len(k1) == 1:
        return lambda k1, k2, k3, k4: (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0],)
    return lambda k1, k2, k3, k4: (
        (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0],) + _weighted(k1[1:], k2[1:], k3[1:], k4[1:])  # noqa: RUF005
    )


@njit(cache=True, nogil=True, inline="always")
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

    x: a tuple of any length. tangent: None, or the `Tangent` that moves with it: `rates` then leaves the derivatives
    of x' in its `stages`, along those of x in `by` at the first stage and in `moved` at the others.
    """
    k1 = rates(x, u_start, system, tangent, 0)
    if tangent is not None:
        _move(tangent.by, tangent.moved, tangent.stages, 0.5 * step, 0)
    k2 = rates(_along(x, 0.5 * step, k1), u_mid, system, tangent, 1)
    if tangent is not None:
        _move(tangent.by, tangent.moved, tangent.stages, 0.5 * step, 1)
    k3 = rates(_along(x, 0.5 * step, k2), u_mid, system, tangent, 2)
    if tangent is not None:
        _move(tangent.by, tangent.moved, tangent.stages, step, 2)
    k4 = rates(_along(x, step, k3), u_end, system, tangent, 3)
    if tangent is not None:
        _finish(tangent.by, tangent.stages, step / 6.0)
    return _along(x, step / 6.0, _weighted(k1, k2, k3, k4))


@njit(cache=True, nogil=True)
def _move(
    by: NDArray[np.float64],
    moved: NDArray[np.float64],
    stages: NDArray[np.float64],
    step: float,
    stage: int,
) -> None:
    """The derivatives as far as a stage's rates lead them; arrays of a `Tangent`, which by itself costs more."""
    for row in range(by.shape[0]):
        for j in range(by.shape[1]):
            moved[row, j] = by[row, j] + step * stages[stage, row, j]


@njit(cache=True, nogil=True)
def _finish(by: NDArray[np.float64], stages: NDArray[np.float64], sixth: float) -> None:
    """The derivatives after a step; the exact derivative of the RK4 step."""
    for row in range(by.shape[0]):
        for j in range(by.shape[1]):
            middle = stages[1, row, j] + stages[2, row, j]
            by[row, j] += sixth * (stages[0, row, j] + 2.0 * middle + stages[3, row, j])


@njit(cache=True, nogil=True, inline="always")
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


@njit(cache=True, nogil=True, inline="always")
def injector_rates(x: Any, u: tuple[float, float], system: System, tangent: Any, stage: int) -> Any:
    """(25)-(26), with their derivatives where a tangent is carried."""
    if tangent is None:
        return right_hand_side(x, u, system.coefficients, system.network)
    direction = tangent.by if stage == 0 else tangent.moved
    return tangent_rates(x, u, system.coefficients, system.network, tangent, direction, tangent.stages[stage])


@njit(cache=True, nogil=True, inline="always")
def _steps_in(x: Any, interval: Interval, c: Coefficients) -> int:
    """RK4 steps an interval needs: `substeps` for the sac, far fewer while only the line moves."""
    if is_at_rest(x, interval.start) and interval.end[1] <= 0.0:
        return min(interval.substeps, math.ceil(interval.length * line_fastest(c.line) / LINE_STEP))
    return interval.substeps


@njit(cache=True, nogil=True)
def runge_kutta(
    x: NDArray[np.float64], interval: Interval, c: Coefficients, network: Network, tangent: Any
) -> None:
    """`advance` without what empties the sac."""
    steps = _steps_in(x, interval, c)
    system, length = System(c, network), interval.length
    integrate(
        injector_rates, between, x, interval.start, interval.end, length, steps, system, tangent, c.line
    )


@njit(cache=True, nogil=True, inline="always")
def advance(
    x: NDArray[np.float64], interval: Interval, c: Coefficients, network: Network, tangent: Any
) -> None:
    """State x (n,) one sample interval later, in place; tangent: the `Tangent` that moves with it, None for none."""
    runge_kutta(x, interval, c, network, tangent)
    empty_if_drained(x, interval.start, interval.end, tangent)


@njit(cache=True, nogil=True, inline="always")
def empty_if_drained(
    x: NDArray[np.float64], u_start: tuple[float, float], u_end: tuple[float, float], tangent: Any
) -> None:
    """A sac that has drained behind a shut needle is at exactly chamber pressure."""
    if u_start[1] <= 0.0 and u_end[1] <= 0.0 and math.fabs(x[2]) < EMPTY_SAC:
        empty_sac(x, tangent)


@njit(cache=True, nogil=True, inline="always")
def empty_sac(x: NDArray[np.float64], tangent: Any) -> None:
    """p_S is at chamber pressure, whatever the parameters."""
    x[2] = 0.0
    if tangent is not None:
        tangent.by[2, :] = 0.0


@njit(cache=True, nogil=True, inline="always")
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


@overload(_over, strict=False)
def _over_compiled(x: Any, interval: Any, knot: Any, c: Any, network: Any, tangent: Any) -> Any:
    line = c.types[c.fields.index("line")].instance_class
    return _leapfrog_over.py_func if line.staggered else _runge_kutta_over.py_func


@njit(cache=True, nogil=True)
def _leapfrog_over(
    x: NDArray[np.float64],
    interval: Interval,
    knot: tuple[float, float],
    c: Coefficients,
    network: Network,
    tangent: Any,
) -> None:
    leapfrog(x, interval, knot, c, network, tangent)
    empty_if_drained(x, interval.start, interval.end, tangent)


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
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
    def staggered(x: Any, u_start: Any, u_middle: Any, u_end: Any, step: Any, c: Any, network: Any) -> None:
        move_line(x, u_start[0], step, c.line, None)
        move_end(x, u_middle, u_end, step, c, network, None)

    def ordinary(x: Any, u_start: Any, u_middle: Any, u_end: Any, step: Any, c: Any, network: Any) -> None:
        state, system = _state(x, c.line), System(c, network)
        _store(runge_kutta_step(injector_rates, state, u_start, u_middle, u_end, step, system, None), x, 0)

    return staggered if c.types[c.fields.index("line")].instance_class.staggered else ordinary
