"""Mass of an event by its own pressures, its interval, and operating points at which the flow is known so well."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from observer_rt.core.learning.matrices import inverse_of
from observer_rt.core.learning.predictor import follow
from observer_rt.core.model.model import Sac
from observer_rt.core.model.needle import NeedleStroke
from observer_rt.core.stream.stream import FULL_LIFT, RAIL_BIN, RAIL_BINS
from observer_rt.engine.estimation import predictor
from observer_rt.engine.estimation.belief import Matrix, Vector
from observer_rt.engine.estimation.parameters import FLOWS, NOZZLE_LAW, WEIGHTS, Parameter, Theta, learned_of
from observer_rt.engine.estimation.predictor import InputVariance, NoiseLevels, OpenLoop, Setting, Window
from observer_rt.engine.learning.run import JITTER_SIZE, ShotDelays
from observer_rt.foundation.units import Z_95, Floats
from observer_rt.model.accuracy import EXACT, StatedAccuracy
from observer_rt.model.network import OF_NOZZLE, activations

# Error of the rate (one sigma) as a share of its change over a sample: inputs are no straight lines at edges.
HOLD_SHARE = 0.06
PARTING = 20e-6  # s (one sigma): uncertainty of the time at which two injections part, at the least flow between.
FAR_FLOW = 0.02  # change of a flow, beyond which a volume is not followed along its slope; P
OWN_SHARE = 0.005  # of a mass, within which hypotheses agree whatever their interval; M
LEAD_SAMPLES = 15  # samples before the opening
LEAST_VOLUME = 1e-13  # m3, of which shares are taken
FURTHER_SAMPLES = 20  # samples after the last rate, by which another theta's may end later
_NOZZLE, _SEAT = int(Parameter.NOZZLE_BIAS), int(Parameter.SEAT_BIAS)
LEAST_SAC_PRESSURE = 0.05  # p_0, down to which a change of the nozzle flow is stated
OPENED_SINCE = 1e-3  # s, at which a change of the nozzle flow is stated
_RISE, _RISE_WITH_SEAT = NOZZLE_LAW.columns.tolist()
MOST_POINTS, MOST_OPENINGS = 16, 48  # remembered; the oldest is forgotten
REACH = (0.4, 0.7, 0.4)  # of each number of an `EventPoint`, over which what is wrong with a model changes
EVENT_SHARE = 0.3  # variance, of what one event tells of its own point, over that between distant points
UNSEEN = 2e-3  # share of a rate: standard deviation of a learned model's error at a point far from all events
FLOW_KNOWN = 0.012  # standard deviation of a flow, as a share, up to which it is known well enough,
FURTHER_OFF = 1.3  # or else up to this factor on its standard deviation at the event
FLOW_LEARNED = 0.03  # standard deviation of the flow at the event, as a share, beyond which no flow is known
_RAILS = RAIL_BIN * (np.arange(RAIL_BINS) + 0.5)  # p_0, middles of the bins of the rail pressure
FULL = 0.95  # p_S over p_L of a sac that is full
_LONG = 0.8  # mean of p_S over p_L in a long injection
NEAR = 0.5 * REACH[0]  # p_0 of rail pressure, within which an event shows the flow
LEAST_AREA = 0.02  # of an event's widest seat area, up to which the lift's noise opens a shut needle
LONGER = 30e-6  # s, by which events of one operating point differ
FAILS = 0.05  # share of new operating points at which what was learned may fail
HOLDS = 0.015  # of a mass, within which it holds
FADING = 0.95  # weight of the new points before a new point
FLOW_FADING = 0.8  # weight of the events before an event, in how far flows are off,
FLOW_EVENTS = 2.0  # and of events that were not, before any
# Share of a flow, by which events differ anyway, and for which an event counts at most.
USUALLY_OFF, FURTHEST_OFF = 0.006, 0.02
_LEAST_FLOW = 0.01  # of a nozzle as given: against a back-pressure above p_S there is none


@dataclass(frozen=True)
class Resimulation:
    """An event re-simulated with the theta learned up to and from it, and the uncertainty of its rate."""

    run: OpenLoop  # over the event's window
    by_inputs: InputVariance  # variance by the noise of the inputs
    covariance: Floats  # (m, m) of the error of the run's theta
    interval: float  # of the samples [s]
    systematic: float = 0.0  # error of the model on a healthy injector, as a share of the volume (one sigma)
    unknown: float = 0.0  # the same on this injector by recent events
    calibration: StatedAccuracy = EXACT  # of the level, which no event shows
    moved: float = 0.0  # share by which the mean over all explanations of the event is larger than the run
    strokes: tuple[NeedleStroke, ...] = ()  # of a needle whose lift is not recorded, in s from the first sample on

    @property
    def model_share(self) -> float:
        """Error of the model as a share of a volume (one sigma): systematic and unknown together."""
        return math.hypot(self.systematic, self.unknown)


class VolumeBudget(NamedTuple):
    """Standard deviations of a volume [m3], by cause."""

    parameters: float  # uncertainty of theta
    inputs: float  # noise of the signals
    model: float  # error of the model on a healthy injector, and far from where it was learned
    calibration: float  # of the level, constant over injections
    parting: float  # flow at the ends of the window that may belong to another injection

    @property
    def learning(self) -> float:
        """Part that further events could reduce: parameters and model."""
        return math.hypot(self.parameters, self.model)

    @property
    def beyond_level(self) -> float:
        """All but the calibration, which every injection shares."""
        return math.hypot(self.learning, self.inputs, self.parting)


def resimulated(
    window: Window, setting: Setting, noise: NoiseLevels, theta: Floats, covariance: Floats
) -> Resimulation:
    """Re-simulate an event with the theta (m,) learned from it, with an error covariance (m, m)."""
    run = predictor.open_loop(window, setting, theta)
    by_inputs = predictor.input_variance(window, run, setting, noise)
    return Resimulation(run, by_inputs, covariance, setting.interval)


def with_shots(event: Resimulation, window: Window, delays: ShotDelays) -> Resimulation:
    """An event whose shots answered commands: what a delay moves is taken for the flow of its own shot."""
    assert window.needle is not None
    opened = window.commands[:, 0] + window.needle.opening_delay / event.interval
    shot = np.searchsorted(opened, np.arange(event.run.rate.size), side="right") - 1
    own = np.maximum(shot, 0)[:, None] == np.arange(opened.size)
    by_delays = event.run.slopes[:, [Parameter.OPENING_DELAY, Parameter.CLOSING_DELAY]] * JITTER_SIZE
    by_shots = (own[:, :, None] * by_delays[:, None, :]).reshape(shot.size, -1)
    volumes = np.cumsum(by_shots, axis=0) * event.interval
    rate, volume = (((each @ delays.covariance) * each).sum(axis=1) for each in (by_shots, volumes))
    return replace(
        event,
        run=event.run._replace(slopes=event.run.slopes + by_shots @ delays.by_theta),
        by_inputs=InputVariance(event.by_inputs.rate + rate, event.by_inputs.volume + volume),
    )


def volume_budget(event: Resimulation, window: slice) -> VolumeBudget:
    """Budget of the uncertainty of the volume injected in a window of the event."""
    gradient = np.trapezoid(event.run.slopes[window], axis=0) * event.interval
    volume = volume_in(event, window)
    return VolumeBudget(
        math.sqrt(max(float(gradient @ event.covariance @ gradient), 0.0)),
        math.sqrt(float(event.by_inputs.volume[window][-1])),
        event.model_share * volume,
        event.calibration.mass * volume,
        PARTING * math.hypot(*event.run.rate[window][[0, -1]]),
    )


def rate_sigma(event: Resimulation, window: slice) -> Floats:
    """Standard deviation [m3/s] of `corrected_rate`."""
    slopes = event.run.slopes[window]
    by_parameters = ((slopes @ event.covariance) * slopes).sum(axis=1)
    by_hold = HOLD_SHARE * np.gradient(event.run.rate)[window]
    by_model = math.hypot(event.model_share, event.calibration.rate) * event.run.rate[window]
    variance = by_parameters + event.by_inputs.rate[window] + by_hold**2 + by_model**2
    return np.asarray(np.sqrt(variance), np.float64)


def volume_in(event: Resimulation, window: slice) -> float:
    """Volume [m3] injected in a window of the event, by its own pressures."""
    return float(np.trapezoid(corrected_rate(event, window))) * event.interval


def corrected_rate(event: Resimulation, window: slice) -> Floats:
    """Rate [m3/s] at the samples of a window of the event, by its own pressures."""
    return np.asarray((1.0 + event.moved) * event.run.rate[window], np.float64)


def flow_off(event: Resimulation, change: Theta) -> float:
    """Root mean square, as a share, by which a change (m,) of theta moves the rate while much flows."""
    rate = event.run.rate
    flows = rate > 0.5 * rate.max()
    return float(np.sqrt(np.mean((event.run.slopes[flows] @ change / rate[flows]) ** 2))) if flows.any() else 0.0


def stroke_in(event: Resimulation, window: slice) -> NeedleStroke | None:
    """Stroke that lies in a window of the event, in s from its first sample on; None where the lift is recorded."""
    start, end = event.interval * window.start, event.interval * window.stop
    for stroke in event.strokes:
        if start < 0.5 * (stroke.opening + stroke.closed) < end:
            times = {
                name: getattr(stroke, name) - start
                for name in ("opening", "top", "closing", "closed", "landed", "rebound")
            }
            return stroke._replace(**times)
    return None


@dataclass(frozen=True, eq=False)
class EventMass:
    """Volume [m3] of an event run with theta (m,), its slopes (m,) as shares; no flow after `flows_until`."""

    window: Window
    setting: Setting
    theta: Theta
    volume: float
    slopes: Theta
    by_inputs: float
    flows_until: int

    def moved(self, theta: Theta) -> float:
        """Share by which the volume is larger with another theta (m,), along its slopes."""
        return float(self.slopes @ (theta - self.theta))

    def moved_far(self, theta: Theta) -> float:
        """The same, open loop where flows are others by much."""
        if np.max(np.abs(theta - self.theta)[list(FLOWS)]) <= FAR_FLOW:
            return self.moved(theta)
        learned, interval = learned_of(theta, self.setting.coefficients), self.setting.interval
        window = self.window.as_learned(learned, self.setting).until(self.flows_until)
        rate, errors = np.empty((2, window.output.size))
        follow(window, self.setting, learned, window.opening, errors, rate, None, predictor.NO_SLOPES)
        volume = float(np.trapezoid(rate[_part(window)])) * interval
        return predictor.level_of(theta, self.setting) * volume / max(self.volume, LEAST_VOLUME) - 1.0

    @property
    def controlled(self) -> float:
        """Control flow of a servo injector while its needle is open, over the injected volume."""
        model, inputs = learned_of(self.theta, self.setting.coefficients).coefficients, self.window.inputs
        opened = inputs[inputs[:, 1] > 0.0, 0] + model.chamber_pressure / model.pressure_scale
        flow: float = model.flow_scale * model.line.control_flow / model.line.a1
        return flow * float(np.sqrt(opened).sum()) * self.setting.interval / max(self.volume, LEAST_VOLUME)

    def variance(self, covariance: Floats) -> float:
        """Variance of the volume, as a share, by a covariance (m, m) of theta."""
        return max(float(self.slopes @ covariance @ self.slopes), 0.0)


class Shares(NamedTuple):
    """Standard deviations of a volume, as shares of it; moved: by which the mean over explanations is larger."""

    from_belief: float
    total: float
    moved: float

    @property
    def remainder(self) -> float:
        """What belief, inputs and model do not explain."""
        return math.sqrt(max(self.total**2 - self.from_belief**2, 0.0))

    @property
    def agreement(self) -> float:
        """Share within which hypotheses agree on a mass."""
        return Z_95 * self.from_belief + OWN_SHARE


def mass_of(window: Window, setting: Setting, theta: Theta, again: Resimulation) -> EventMass:
    """Mass of an event that was run again with theta (m,)."""
    part = _part(window)
    volume = float(np.trapezoid(again.run.rate[part])) * setting.interval
    # where nothing flows at either end, as by trapezoids
    slopes = np.ones(window.output.size - part.start) @ again.run.slopes[part]
    slopes *= setting.interval / max(volume, LEAST_VOLUME)
    by_inputs = float(again.by_inputs.volume[-1]) / max(volume, LEAST_VOLUME) ** 2
    flows_until = int(np.flatnonzero(again.run.rate)[-1]) + FURTHER_SAMPLES if volume > 0.0 else window.output.size
    return EventMass(window, setting, theta, volume, slopes, by_inputs, flows_until)


def _part(window: Window) -> slice:
    return slice(max(window.opening - LEAD_SAMPLES, 0), window.output.size)


class EventPoint(NamedTuple):
    rail_pressure: float  # at the opening [p_0]
    log_open_time: float  # ln of the time [s] the needle is up, until it falls, in the longest opening
    area: float  # widest


def opening_points(window: Window, interval: float) -> tuple[EventPoint, ...]:
    """Operating points of an event's openings that are more than noise, the longest last; interval of samples [s]."""
    area, rail = window.inputs[:, 1], float(window.inputs[window.opening, 0])
    changes = np.flatnonzero(np.diff(np.concatenate(([False], area > 0.0, [False]))))
    least, points = LEAST_AREA * float(area.max()), []
    for begin, end in changes.reshape(-1, 2).tolist():
        opened = area[begin:end]
        widest = float(opened.max())
        if widest > least:
            up = int(np.flatnonzero(opened >= FULL_LIFT * widest)[-1]) + 1
            points.append(EventPoint(rail, math.log(up * interval), widest))
    return tuple(sorted(points, key=lambda each: each.log_open_time)) or (EventPoint(rail, math.log(interval), 0.0),)


def extrapolation_sigma(point: EventPoint, learned_at: Sequence[EventPoint]) -> float:
    """Standard deviation 0 .. 1 of a model's error at a point after events elsewhere, over that with no event, 1.

    By a Gaussian process of unit variance, covariance falling off with the squared distance over `REACH` (Rasmussen,
    Williams, Gaussian Processes for Machine Learning, equation (2.26)).
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
    squares: float = 0.0  # of shares by which flows were off, older ones counting less
    events: float = 0.0  # number of these

    def after(self, holds: bool, openings: Sequence[EventPoint], learned_at: Sequence[EventPoint]) -> "Transfer":
        """The next value, after an event with these openings; learned_at: points of those before."""
        after = replace(self, shown=(*(self.shown if holds else ()), *openings)[-MOST_OPENINGS:])
        if not learned_at or not is_new(openings[-1], learned_at):
            return after
        return replace(after, held=FADING * self.held + holds, failed=FADING * self.failed + (not holds))

    def with_flow(self, off: float) -> "Transfer":
        """The next value, after an event whose flow was off by a share."""
        square = max(min(off, FURTHEST_OFF) ** 2 - USUALLY_OFF**2, 0.0)
        return replace(self, squares=FLOW_FADING * self.squares + square, events=FLOW_FADING * self.events + 1.0)

    @property
    def spread(self) -> float:
        """Standard deviation by which flows of late were others than believed, beyond the usual, as a share."""
        return math.sqrt(self.squares / (FLOW_EVENTS + self.events))

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
    event: Resimulation, theta: Floats, covariance: Floats, point: EventPoint, transfer: Transfer
) -> KnownFlow:
    """Range of the flow that is known with theta (m,), whose error has the covariance (m, m).

    `event`, the last one, shows how its volume changes with theta. The nozzle's share of that grows with the sac's
    filling: p_S / p_L = d ln Q_H / d ln (1 + N_H) of a steady flow. A bin of rail pressure is known if the flow's
    error there is small, for as long as openings near it were since learning last failed: theta moved at one pressure
    and time may be worse at others. It is known without end if learning held at new points.
    """
    pressures, middle = np.append(_RAILS, point.rail_pressure), 0.5 * math.exp(point.log_open_time)
    states = np.array([pressures, np.zeros_like(pressures), FULL * pressures])
    change, slopes = nozzle_change(theta, states, (pressures, point.area), middle)
    by_nozzle = slopes / np.maximum(1.0 + change, _LEAST_FLOW)[:, None]  # the last row is at the event's rail
    injected, full = float(event.run.rate.sum()), by_nozzle[-1]
    if not (injected > 0.0 and full[_NOZZLE] > 0.0):
        return NOWHERE
    here = np.ones(event.run.rate.size) @ event.run.slopes / injected  # of the logarithm of what was injected
    filled = min(max(here[_NOZZLE] / full[_NOZZLE], 0.0), FULL)

    def sigma(fullness: float, by_rail: Floats | float = 0.0) -> Floats:
        """Relative sigma of a flow, slopes interpolated between event and full sac; by_rail: their change."""
        share = (fullness - filled) / (1.0 - filled)
        slopes = here + share * (full - here) + fullness * by_rail
        return np.asarray(np.sqrt(np.maximum(((slopes @ covariance) * slopes).sum(axis=-1), 0.0)))

    def enough(fullness: float) -> float:
        return max(FLOW_KNOWN, FURTHER_OFF * float(sigma(fullness)))

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


def nozzle_change(
    theta: Theta,
    x: Sequence[float] | Vector,
    u: Sequence[float | Vector] | Vector,
    since: float | Vector = OPENED_SINCE,
) -> tuple[Vector, Matrix]:
    """Relative change (...) of the nozzle flow at states x (3, ...) and inputs u (2, ...); slopes (..., m).

    (1 + N_H) sqrt((x3 - d)/x3) - 1: network and back-pressure d, v_H of (27). since [s]: the needle is open.
    """
    sigmas, area = activations(x, (u[0], u[1], since))[..., :OF_NOZZLE], u[1]
    factor = 1.0 + theta[_NOZZLE] + sigmas @ theta[WEIGHTS[:OF_NOZZLE]]
    x_3, rises = np.maximum(x[2], LEAST_SAC_PRESSURE), NOZZLE_LAW.of(theta)
    against_chamber = np.sqrt(np.maximum(1.0 - (rises[0] + rises[1] * area) / x_3, 0.0))
    slopes = np.zeros((*sigmas.shape[:-1], theta.size))
    slopes[..., _NOZZLE] = against_chamber
    slopes[..., WEIGHTS[:OF_NOZZLE]] = np.multiply(against_chamber[..., None], sigmas)
    divisor = np.where(against_chamber > 0.0, against_chamber, np.inf)  # without flow no slope
    slopes[..., _RISE] = -0.5 * factor / (x_3 * divisor)
    slopes[..., _RISE_WITH_SEAT] = slopes[..., _RISE] * area
    return factor * against_chamber - 1.0, slopes


def seat_change(theta: Theta, area: float | Vector, drop: float | Vector) -> tuple[Vector, Matrix]:
    """Relative change N_S of the seat flow (...) at a seat area [A_0] and a pressure drop [p_0]; slopes (..., m)."""
    sigmas = activations((drop, 0.0, 0.0), (0.0, area, 0.0))[..., OF_NOZZLE:]
    slopes = np.zeros((*sigmas.shape[:-1], theta.size))
    slopes[..., _SEAT] = 1.0
    slopes[..., WEIGHTS[OF_NOZZLE:]] = sigmas
    return slopes @ theta, slopes


def flow_change(theta: Theta, opened: Floats, sac: Sac) -> float:
    """Relative change of a steady flow through seat and nozzle at inputs u (2,) of an open needle; chamber empty."""
    rail, area = float(opened[0]), max(float(opened[1]), 1e-6)  # shut: the seat decides
    needed = (sac.a6 / (sac.a5 * area)) ** 2  # drop over the seat for one of 1 over the nozzle, nothing changed
    drop = rail * needed / (1.0 + needed)
    wider = 1.0 + float(nozzle_change(theta, np.array([rail, 0.0, rail - drop]), opened)[0])
    freer = max(1.0 + float(seat_change(theta, area, drop)[0]), 0.01)
    return wider * math.sqrt((1.0 + needed) / (1.0 + needed * (wider / freer) ** 2)) - 1.0
