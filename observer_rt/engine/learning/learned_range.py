"""The range in which a model was learned: operating points of events, errors away from them, flows known by them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.matrices import inverse_of
from observer_rt.core.stream.stream import RAIL_BIN, RAIL_BINS
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.estimation.scalars import Parameter
from observer_rt.engine.learning.indicators import nozzle_change
from observer_rt.engine.learning.interval import Resimulation

_NOZZLE = int(Parameter.NOZZLE_BIAS)
MOST_POINTS, MOST_OPENINGS = 16, 48  # remembered; the oldest is forgotten
REACH = (0.4, 0.7, 0.4)  # of each number of an `EventPoint`, over which what is wrong with a model changes
EVENT_SHARE = 0.3  # variance, of what one event tells of its own point, over that between distant points
UNSEEN = 2e-3  # share of a rate: standard deviation of a learned model's error at a point far from all events
FLOW_KNOWN = 0.012  # standard deviation of a flow, as a share, up to which it is known well enough,
FURTHER = 1.3  # or else up to this factor on its standard deviation at the event
FLOW_LEARNED = 0.03  # standard deviation of the flow at the event, as a share, beyond which no flow is known
_RAILS = RAIL_BIN * (np.arange(RAIL_BINS) + 0.5)  # p_0, middles of the bins of the rail pressure
FULL = 0.95  # p_S over p_L of a sac that is full
_LONG = 0.8  # mean of p_S over p_L in a long injection
NEAR = 0.5 * REACH[0]  # p_0 of rail pressure, within which an event shows the flow
FULL_LIFT = 0.9  # of the widest seat area, below which a needle falls
LEAST_AREA = 0.02  # of an event's widest seat area, up to which the lift's noise opens a shut needle
LONGER = 30e-6  # s, by which events of one operating point differ
FAILS = 0.05  # share of new operating points at which what was learned may fail
HOLDS = 0.015  # of a mass, within which it holds
FADING = 0.95  # weight of the new points before a new point
_LEAST_FLOW = 0.01  # of a nozzle as given: against a back-pressure above p_S there is none


class EventPoint(NamedTuple):
    """Operating point of an event."""

    rail_pressure: float  # at the opening [p_0]
    log_open_time: float  # ln of the time [s] the needle is up, until it falls, in the longest opening
    area: float  # widest


def opening_points(window: Window, interval: float) -> tuple[EventPoint, ...]:
    """Operating points of an event's openings that are more than noise, the longest last; interval of samples [s]."""
    area, rail = window.inputs[:, 1], float(window.inputs[window.opening, 0])
    shut = np.flatnonzero(np.concatenate(([True], area <= 0.0, [True])))
    points = []
    for begin, end in pairwise(shut.tolist()):
        opened = area[begin : end - 1]
        widest = float(opened.max(initial=0.0))
        if widest > LEAST_AREA * area.max():
            up = int(np.flatnonzero(opened >= FULL_LIFT * widest)[-1]) + 1
            points.append(EventPoint(rail, math.log(up * interval), widest))
    return tuple(sorted(points, key=lambda each: each.log_open_time)) or (EventPoint(rail, math.log(interval), 0.0),)


def extrapolation_sigma(point: EventPoint, learned_at: Sequence[EventPoint]) -> float:
    """Standard deviation 0 .. 1 of a model's error at a point after events elsewhere, over that with no event, 1.

    By a Gaussian process of unit variance, whose covariance falls off with the squared distance over `REACH`:
    Rasmussen, Williams, Gaussian Processes for Machine Learning, equation (2.26).
    """
    if not learned_at:
        return 1.0
    points = np.array([*learned_at, point]) / REACH
    covariance = np.exp(-0.5 * np.sum((points[:, None, :] - points[None, :, :]) ** 2, axis=2))
    among, across = covariance[:-1, :-1], covariance[:-1, -1]
    explained = across @ inverse_of(among + EVENT_SHARE * np.eye(len(learned_at)))[0] @ across
    return math.sqrt(max(1.0 - float(explained), 0.0))


def with_point(learned_at: Sequence[EventPoint], point: EventPoint) -> tuple[EventPoint, ...]:
    """The points with another, the newest last, MOST_POINTS at most."""
    return (*learned_at, point)[-MOST_POINTS:]


def is_new(point: EventPoint, learned_at: Sequence[EventPoint]) -> bool:
    """Whether the needle is up longer at a point than in all events near its rail pressure."""
    longest = (
        math.exp(each.log_open_time) for each in learned_at if abs(point.rail_pressure - each.rail_pressure) <= NEAR
    )
    return math.exp(point.log_open_time) > max(longest, default=0.0) + LONGER


@dataclass(frozen=True)
class Transfer:
    """Where what was learned held: openings, and numbers of new operating points; older ones count less."""

    held: float = 0.0
    failed: float = 0.0
    shown: tuple[EventPoint, ...] = ()  # openings of the events from the last one on at which it failed

    def after(self, holds: bool, openings: Sequence[EventPoint], learned_at: Sequence[EventPoint]) -> "Transfer":
        """The next value, after an event with these openings; learned_at: points of those before."""
        shown = (*(self.shown if holds else ()), *openings)[-MOST_OPENINGS:]
        if not learned_at or not is_new(openings[-1], learned_at):
            return replace(self, shown=shown)
        return Transfer(FADING * self.held + holds, FADING * self.failed + (not holds), shown)

    @property
    def is_trusted(self) -> bool:
        """Whether few of the next ones are expected to fail; the Beta prior is one event, a quarter of it failed."""
        return (self.failed + 0.25) / (self.held + self.failed + 1.0) <= FAILS


class KnownFlow(NamedTuple):
    """Rail pressures and times since the opening at which the flow is known well enough."""

    rail_from: float  # rail pressure [p_0], around the event's
    rail_to: float
    since: tuple[float, ...]  # (RAIL_BINS,) of each bin of rail pressure [s]: for a needle that falls
    until: tuple[float, ...]  # (RAIL_BINS,) [s]; 0: at no time


EVERYWHERE = KnownFlow(-math.inf, math.inf, (0.0,) * RAIL_BINS, (math.inf,) * RAIL_BINS)
NOWHERE = KnownFlow(math.inf, -math.inf, (0.0,) * RAIL_BINS, (0.0,) * RAIL_BINS)


def known_flow(
    event: Resimulation,
    theta: NDArray[np.float64],
    covariance: NDArray[np.float64],
    point: EventPoint,
    transfer: Transfer,
) -> KnownFlow:
    """Range of the flow that is known with theta (m,), whose error has the covariance (m, m).

    `event`, the last one, at a point, shows how its injected volume changes with theta. The fuller the sac, the
    larger is the nozzle's share of that: p_S / p_L = d ln Q_H / d ln (1 + N_H) of a steady flow. N_H depends on the
    rail pressure: a bin of that is known if the error of the flow there is small enough, for as long as openings near
    it were, since what was learned failed last: theta that was moved at one combination of pressure and time may have
    become worse at others. It is known without end if what was learned held at new points.
    """
    pressures, middle = np.append(_RAILS, point.rail_pressure), 0.5 * math.exp(point.log_open_time)
    states = np.array([pressures, np.zeros_like(pressures), FULL * pressures])
    change, slopes = nozzle_change(theta, states, (pressures, point.area), middle)
    # the last row is at the event's rail pressure
    by_nozzle = slopes / np.maximum(1.0 + change, _LEAST_FLOW)[:, None]
    injected, full = float(event.run.rate.sum()), by_nozzle[-1]
    if not (injected > 0.0 and full[_NOZZLE] > 0.0):
        return NOWHERE
    here = np.ones(event.run.rate.size) @ event.run.slopes / injected  # of the logarithm of what was injected
    filled = min(max(here[_NOZZLE] / full[_NOZZLE], 0.0), FULL)

    def sigma(fullness: float, by_rail: NDArray[np.float64] | float = 0.0) -> NDArray[np.float64]:
        """Standard deviation of a flow, as a share, its slopes interpolated between the event's and a full sac's.

        by_rail: slopes of a full sac at other rail pressures less those at the event's.
        """
        share = (fullness - filled) / (1.0 - filled)
        slopes = here + share * (full - here) + fullness * by_rail
        return np.asarray(np.sqrt(np.maximum(((slopes @ covariance) * slopes).sum(axis=-1), 0.0)))

    def enough(fullness: float) -> float:
        return max(FLOW_KNOWN, FURTHER * float(sigma(fullness)))

    if sigma(filled) > FLOW_LEARNED:
        return NOWHERE
    fullness = max(filled, _LONG) if sigma(1.0) <= enough(filled) else filled
    shown = np.reshape(transfer.shown, (-1, 3, 1))  # one an opening
    is_near, times = np.abs(_RAILS - shown[:, 0]) <= NEAR, np.exp(shown[:, 1])
    since = np.where(is_near, times - LONGER - 2.0 * event.interval, math.inf).min(axis=0, initial=math.inf)
    until = np.where(is_near, times + LONGER, 0.0).max(axis=0, initial=0.0)
    own_bin = min(int(point.rail_pressure / RAIL_BIN), RAIL_BINS - 1)
    if transfer.is_trusted:
        since[:], until[:] = 0.0, math.inf
    is_known = sigma(fullness, by_nozzle[:-1] - full) <= enough(fullness)
    is_known[own_bin] = True
    unknown = np.flatnonzero(~is_known | (until == 0.0))
    below, above = unknown[unknown < own_bin], unknown[unknown > own_bin]
    rail_from = RAIL_BIN * (int(below[-1]) + 1) if below.size else -math.inf
    rail_to = RAIL_BIN * int(above[0]) if above.size else math.inf
    until = np.where(is_known, until, 0.0)
    return KnownFlow(rail_from, rail_to, tuple(since.tolist()), tuple(until.tolist()))
