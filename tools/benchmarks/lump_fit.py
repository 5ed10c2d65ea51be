"""The lump of the peers on tier B, fitted to recordings by the innovations of its Kalman predictor, and by rates."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from tests.plants.arrays import Array
from tests.plants.parameters import Injector
from tests.plants.plant import LINE_NOISE, RAIL_NOISE, Outcome
from tools.benchmarks.peer_equations import (
    PRESSURE_SCALE,
    Model,
    PeerInputs,
    Span,
    line_gain,
    lump_model,
    peer_inputs,
    predict,
)

LEAD, BURN_IN = 2e-3, 1e-3  # s of shut needle before an event's opening; of it, not counted
RATE_NOISE = 0.5e-6  # m3/s, of a sample of a measured rate
EVENTS_USED = 2  # of each recording
SPREAD = 1.0  # of the logarithms of stiffness, loss, seat and nozzle: they may be off by some factor


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


def steady_gain(inputs: PeerInputs) -> tuple[Array, float]:
    """Kalman gain on [x1, x2] of the line at rest, and the innovation's sigma (normalised)."""
    m, t = inputs.model, inputs.stream.interval
    rail, line = RAIL_NOISE / PRESSURE_SCALE, LINE_NOISE / PRESSURE_SCALE
    return line_gain(math.sqrt(m.a1 * m.a3) * t, math.sqrt(m.a1 / m.a3), 0.0, rail, line)


def innovations(inputs: PeerInputs, segment: Segment, gain: Array) -> Array:
    """Counted innovations of a segment, normalised."""
    errors, sac = np.empty((2, segment.end - segment.first))
    span = Span(segment.first, segment.end, segment.end)
    predict(inputs.stream, inputs.model, gain, span, errors, sac)
    return errors[segment.counted - segment.first :]


def open_loop_rate(inputs: PeerInputs, segment: Segment, gain: Array) -> Array:
    """Injection rate [m3/s] over [first, closed) of a segment, the gain stopped at the opening."""
    errors, sac = np.empty((2, segment.closed - segment.first))
    span = Span(segment.first, segment.opening, segment.closed)
    predict(inputs.stream, inputs.model, gain, span, errors, sac)
    root = sac / np.sqrt(np.sqrt(sac**2 + inputs.model.transition**2))
    return np.asarray(inputs.model.nozzle_flow * root, np.float64)


def fitted_lump(outcomes: Sequence[Outcome], part: Injector, with_rate: bool) -> Model:
    """The lump whose innovations, and rates, are smallest."""

    def residuals(logs: Array) -> Array:
        model = lump_of(part, logs)
        return np.concatenate([_residuals(outcome, model, with_rate) for outcome in outcomes])

    found = least_squares(residuals, np.zeros(4), bounds=(-2.0, 2.0), x_scale=SPREAD, diff_step=1e-3)
    return lump_of(part, found.x)


def lump_of(part: Injector, logs: Array) -> Model:
    """The lump with stiffness, loss, seat and nozzle times exp(logs) (4,)."""
    stiffness, loss, seat, nozzle = np.exp(logs)
    changed = part._replace(
        bulk_modulus_line=part.bulk_modulus_line * stiffness,
        line_loss=part.line_loss * loss,
        seat_coefficient=part.seat_coefficient * seat,
        nozzle_area=part.nozzle_area * nozzle,
    )
    return lump_model(changed, sac_follows=True)


def _residuals(outcome: Outcome, model: Model, with_rate: bool) -> Array:
    inputs = peer_inputs(outcome.measured, model)
    gain, sigma = steady_gain(inputs)
    found = []
    for segment in segments_of(inputs)[:EVENTS_USED]:
        found.append(innovations(inputs, segment, gain) / sigma)
        if with_rate:
            rate = open_loop_rate(inputs, segment, gain)
            noise = np.random.default_rng(segment.first).normal(0.0, RATE_NOISE, rate.size)
            measured = outcome.truth.injection_rate[segment.first : segment.closed] + noise
            found.append((measured - rate) / RATE_NOISE)
    return np.concatenate(found)
