"""The information limit (Cramer-Rao) of the mass: what no estimator with this prior and drift can beat.

The nominal structure linearised at the true parameters. Rail noise drives the line, so the innovations of the Kalman
predictor are what is white; the information of all earlier events counts, as does the drift between them. The event's
own innovations do not: its estimate is given while it happens.
"""

import math
from dataclasses import dataclass

import numpy as np

from tests.plants.arrays import Array
from tests.plants.parameters import Faults
from tests.plants.plant import LINE_NOISE, RAIL_NOISE
from tests.plants.windows import Windows
from tools.benchmarks.peer_equations import (
    LAG,
    PARAMETERS,
    PRESSURE_SCALE,
    V_H,
    PeerInputs,
    Span,
    line_gain,
    predict,
)

# v_H, v_S, friction k, leak c [m3/(s Pa)], offset o [p0], lag tau [s], stiffness r
PRIOR_SIGMA = np.array([0.45, 0.4, 1.75, 5.5e-14, 0.025, 35e-6, 0.18])
DRIFT_SIGMA = np.array([5e-4, 5e-4, 2e-3, 2e-16, 2e-5, 1e-7, 2e-4])  # per event
STEPS = 1e-3 * PRIOR_SIGMA  # for sensitivities
LEAD, BURN_IN = 2e-3, 1e-3  # s of shut needle before an event's opening; of it, not counted


@dataclass(frozen=True)
class Segment:
    """Samples of one event: predicted from `first` on, counted from `counted` on, to the next event's lead."""

    first: int
    counted: int
    opening: int
    closed: int
    end: int


def segments_of(inputs: PeerInputs) -> tuple[Segment, ...]:
    """One segment an event; the first holds the standstill before it."""
    interval = inputs.stream.interval
    lead, burn_in = round(LEAD / interval), round(BURN_IN / interval)
    openings, closed = inputs.events[:, 0], inputs.events[:, 1]
    ends = np.append(openings[1:] - lead + burn_in, inputs.stream.output.size)
    firsts = np.maximum(openings - lead, 0)
    firsts[0] = 0
    return tuple(
        Segment(int(f), int(f) + burn_in, int(o), int(c), int(e))
        for f, o, c, e in zip(firsts, openings, closed, ends, strict=True)
    )


def steady_gain(inputs: PeerInputs, lag: float) -> tuple[Array, float]:
    """Kalman gain (3,) on [x1, x2, lagged x1] of the line at rest, and the innovation's sigma (normalised)."""
    m, t = inputs.model, inputs.stream.interval
    rail, line = RAIL_NOISE / PRESSURE_SCALE, LINE_NOISE / PRESSURE_SCALE
    return line_gain(math.sqrt(m.a1 * m.a3) * t, math.sqrt(m.a1 / m.a3), lag / t, rail, line)


def innovations(inputs: PeerInputs, segment: Segment, theta: Array, gain: Array) -> Array:
    """Counted innovations of a segment, normalised."""
    errors, sac = np.empty((2, segment.end - segment.first))
    end = segment.end
    predict(inputs.stream, inputs.model, theta, gain, Span(segment.first, end, end), errors, sac)
    return errors[segment.counted - segment.first :]


def sensitivities(inputs: PeerInputs, segment: Segment, theta: Array, gain: Array) -> tuple[Array, Array]:
    """Innovations (n,) and their derivatives (n, PARAMETERS)."""
    base = innovations(inputs, segment, theta, gain)
    slopes = np.empty((base.size, PARAMETERS))
    for i, moved in enumerate(theta + np.diag(STEPS)):
        slopes[:, i] = (innovations(inputs, segment, moved, gain) - base) / STEPS[i]
    return base, slopes


def open_loop_rate(inputs: PeerInputs, segment: Segment, theta: Array, gain: Array) -> Array:
    """Injection rate [m3/s] over [first, closed) of a segment, the gain stopped at the opening."""
    errors, sac = np.empty((2, segment.closed - segment.first))
    span = Span(segment.first, segment.opening, segment.closed)
    predict(inputs.stream, inputs.model, theta, gain, span, errors, sac)
    root = sac / np.sqrt(np.sqrt(sac**2 + inputs.model.transition**2))
    return np.asarray(inputs.model.nozzle_flow * (1.0 + theta[V_H]) * root, np.float64)


def true_parameters(faults: Faults) -> Array:
    """The parameters (PARAMETERS,) that are faults of the plant; other faults have none."""
    offset = faults.line_pressure_sensor_offset - faults.rail_pressure_sensor_offset
    f, shift = faults, offset / PRESSURE_SCALE
    of_line = (f.line_friction, f.guide_leakage, shift, f.line_pressure_sensor_lag, f.bulk_modulus)
    return np.array([f.orifice_area, f.seat_area, *of_line])


def mass_limits_mg(
    inputs: PeerInputs, windows: Windows, faults: tuple[Faults, ...], density: float
) -> tuple[float, ...]:
    """Smallest standard deviation of each event's mass [mg], given the events before it; `faults`: at every event."""
    covariance = np.diag(PRIOR_SIGMA**2)
    limits = []
    for number, segment in enumerate(segments_of(inputs)):
        theta = true_parameters(faults[number])
        gain, sigma = steady_gain(inputs, theta[LAG])

        masses = []
        for moved in theta + np.vstack([np.zeros(PARAMETERS), np.diag(STEPS)]):
            rate = np.zeros(inputs.stream.output.size)
            rate[segment.first : segment.closed] = open_loop_rate(inputs, segment, moved, gain)
            masses.append(windows.event_masses_mg(rate, density)[number])
        slope = (np.array(masses[1:]) - masses[0]) / STEPS
        limits.append(float(np.sqrt(slope @ covariance @ slope)))
        _, slopes = sensitivities(inputs, segment, theta, gain)
        information = np.linalg.inv(covariance) + slopes.T @ slopes / sigma**2
        covariance = np.linalg.inv(information) + np.diag(DRIFT_SIGMA**2)
    return tuple(limits)
