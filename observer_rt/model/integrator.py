"""Classical Runge-Kutta of fourth order, with inputs linear between samples.

What a step calls is inlined: passing coefficients and weights by value would cost more than the arithmetic.
"""

import math

from numba import njit

from observer_rt.model.coefficients import Coefficients
from observer_rt.model.network import Network
from observer_rt.model.right_hand_side import is_at_rest, right_hand_side

EMPTY_SAC = 1e-7  # of p_0: a shut, drained sac this close to chamber pressure is at it
LINE_STEP = 0.1  # radians of the line mode an RK4 step may span while nothing flows through the needle


@njit(cache=True, nogil=True, inline="always")
def between(u_start: tuple[float, float], u_end: tuple[float, float], share: float) -> tuple[float, float]:
    """Inputs at a share (0..1) of the way between two samples.

    A negative area is a shut seat: a sample at which the needle is shut may carry the negative area from which, or
    to which, the ramp leads, so that the seat opens and shuts between the samples where the needle does.
    """
    area = u_start[1] + share * (u_end[1] - u_start[1])
    return u_start[0] + share * (u_end[0] - u_start[0]), max(area, 0.0)


@njit(cache=True, nogil=True, inline="always")
def along(
    x: tuple[float, float, float], step: float, rate: tuple[float, float, float]
) -> tuple[float, float, float]:
    """x + step * rate."""
    return x[0] + step * rate[0], x[1] + step * rate[1], x[2] + step * rate[2]


@njit(cache=True, nogil=True, inline="always")
def step_end(
    x: tuple[float, float, float],
    step: float,
    k1: tuple[float, float, float],
    k2: tuple[float, float, float],
    k3: tuple[float, float, float],
    k4: tuple[float, float, float],
) -> tuple[float, float, float]:
    """The state after an RK4 step, from its four stages."""
    sixth = step / 6.0
    return (
        x[0] + sixth * (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0]),
        x[1] + sixth * (k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1]),
        x[2] + sixth * (k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2]),
    )


@njit(cache=True, nogil=True, inline="always")
def runge_kutta_step(
    x: tuple[float, float, float],
    u_start: tuple[float, float],
    u_mid: tuple[float, float],
    u_end: tuple[float, float],
    step: float,
    c: Coefficients,
    network: Network,
) -> tuple[float, float, float]:
    """One RK4 step of length `step` [s]; fourth order for inputs sampled at its start, middle and end."""
    k1 = right_hand_side(x, u_start, c, network)
    k2 = right_hand_side(along(x, 0.5 * step, k1), u_mid, c, network)
    k3 = right_hand_side(along(x, 0.5 * step, k2), u_mid, c, network)
    k4 = right_hand_side(along(x, step, k3), u_end, c, network)
    end: tuple[float, float, float] = step_end(x, step, k1, k2, k3, k4)
    return end


@njit(cache=True, nogil=True, inline="always")
def steps_in(
    x: tuple[float, float, float],
    u_start: tuple[float, float],
    u_end: tuple[float, float],
    interval: float,
    substeps: int,
    c: Coefficients,
) -> int:
    """RK4 steps an interval needs: `substeps` for the sac, far fewer while only the line moves."""
    if is_at_rest(x, u_start) and u_end[1] <= 0.0:
        return min(substeps, math.ceil(interval * math.sqrt(c.a1 * c.a3) / LINE_STEP))
    return substeps


@njit(cache=True, nogil=True)
def advance(
    x: tuple[float, float, float],
    u_start: tuple[float, float],
    u_end: tuple[float, float],
    interval: float,
    substeps: int,
    c: Coefficients,
    network: Network,
) -> tuple[float, float, float]:
    """State one sample interval [s] later, inputs linear from u_start to u_end; at most `substeps` RK4 steps."""
    steps = steps_in(x, u_start, u_end, interval, substeps, c)
    for i in range(steps):
        x = runge_kutta_step(
            x,
            between(u_start, u_end, i / steps),
            between(u_start, u_end, (i + 0.5) / steps),
            between(u_start, u_end, (i + 1.0) / steps),
            interval / steps,
            c,
            network,
        )
    end: tuple[float, float, float] = emptied(x, u_start, u_end)
    return end


@njit(cache=True, nogil=True)
def advance_over(
    x: tuple[float, float, float],
    u_start: tuple[float, float],
    knot: tuple[float, float],
    u_end: tuple[float, float],
    interval: float,
    substeps: int,
    c: Coefficients,
    network: Network,
) -> tuple[float, float, float]:
    """`advance` where the area is linear only up to a knot within the interval, and from it on.

    knot: the share (0..1) of the interval it comes after, and the normalised area there; a share of 0 is none.
    """
    share = knot[0]
    if not is_bent(u_start, knot, u_end):
        end: tuple[float, float, float] = advance(x, u_start, u_end, interval, substeps, c, network)
        return end
    u_knot = at_knot(u_start, knot, u_end)
    x = advance(x, u_start, u_knot, share * interval, math.ceil(share * substeps), c, network)
    rest = 1.0 - share
    beyond: tuple[float, float, float] = advance(
        x, u_knot, u_end, rest * interval, math.ceil(rest * substeps), c, network
    )
    return beyond


@njit(cache=True, nogil=True, inline="always")
def is_bent(u_start: tuple[float, float], knot: tuple[float, float], u_end: tuple[float, float]) -> bool:
    """Whether a knot within an interval means anything: the needle is open somewhere in it."""
    return 0.0 < knot[0] < 1.0 and (u_start[1] > 0.0 or knot[1] > 0.0 or u_end[1] > 0.0)


@njit(cache=True, nogil=True, inline="always")
def at_knot(
    u_start: tuple[float, float], knot: tuple[float, float], u_end: tuple[float, float]
) -> tuple[float, float]:
    """The inputs at a knot: its area, and the rail pressure, which is linear across it."""
    return u_start[0] + knot[0] * (u_end[0] - u_start[0]), knot[1]


@njit(cache=True, nogil=True, inline="always")
def emptied(
    x: tuple[float, float, float], u_start: tuple[float, float], u_end: tuple[float, float]
) -> tuple[float, float, float]:
    """The state with a sac that has drained behind a shut needle at exactly chamber pressure."""
    if u_start[1] <= 0.0 and u_end[1] <= 0.0 and math.fabs(x[2]) < EMPTY_SAC:
        return x[0], x[1], 0.0
    return x
