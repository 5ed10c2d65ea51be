"""How well injection rate and injected volume are known, with variance added away from learned operating points."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.estimation.open_loop import InputVariance, OpenLoop, input_variance, open_loop
from observer_rt.engine.estimation.predictor import Setting, Window
from observer_rt.engine.estimation.scalars import SCALARS, Parameter, Scalars
from observer_rt.engine.learning.indicators import nozzle_change

_NOZZLE = int(Parameter.NOZZLE_BIAS)
# Of the rate's change from sample to sample (one sigma): between samples the inputs are no straight lines, least of
# all where the needle leaves its seat and comes back.
HOLD_SHARE = 0.06
# Of the volume: a published one that differs more from the re-simulated one was not known well.
REVISED = 0.02


@dataclass(frozen=True)
class Resimulated:
    """An event re-simulated with what was learned up to it and from it, and how uncertain that leaves its rate.

    run: over the event's window; by_inputs: by the noise of the inputs. covariance: of the error of the theta it was
    run with (m, m); carried_covariance: of the theta in force when the rate was published. interval: of the samples
    [s]. systematic: standard deviation, as a share, of what the model gets wrong of a healthy injector.
    """

    run: OpenLoop
    by_inputs: InputVariance
    covariance: NDArray[np.float64]
    carried_covariance: NDArray[np.float64]
    interval: float
    systematic: float = 0.0


def resimulated(
    window: Window,
    setting: Setting,
    noise: NoiseLevels,
    theta: NDArray[np.float64],
    covariance: NDArray[np.float64],
    carried_covariance: NDArray[np.float64],
    scalars: Scalars = SCALARS,
) -> Resimulated:
    """An event with what was learned from it, theta (m,); the covariances as in `Resimulated`."""
    run = open_loop(window, setting, theta, scalars)
    by_inputs = input_variance(window, run, setting, noise)
    return Resimulated(run, by_inputs, covariance, carried_covariance, setting.interval)


def volume_interval(event: Resimulated, window: slice, published: float) -> tuple[float, float]:
    """95 % interval of the volume [m3] injected in a window of the event, with the published volume in it.

    It is that of the re-simulated volume; one published that was not known so well, nan: none was, is at its end.
    """
    volume = _volume(event, window)
    gradient = np.trapezoid(event.run.slopes[window], axis=0) * event.interval
    by_parameters = float(gradient @ event.covariance @ gradient)
    by_inputs = float(event.by_inputs.volume[window][-1])
    by_model = (event.systematic * volume) ** 2
    sigma = float(np.sqrt(by_parameters + by_inputs + by_model))
    low, high = volume - 1.96 * sigma, volume + 1.96 * sigma
    return (low, high) if math.isnan(published) else (min(low, published), max(high, published))


def is_revised(event: Resimulated, window: slice, volume: float) -> bool:
    """Whether what was learned from the event contradicts the volume [m3] published for a window of it."""
    learned = _volume(event, window)
    return not abs(volume - learned) <= REVISED * abs(learned)


def rate_sigma(event: Resimulated, window: slice) -> NDArray[np.float64]:
    """Standard deviation [m3/s] of the rate published at the samples of a window of the event."""
    slopes = event.run.slopes[window]
    by_parameters = np.einsum("ki,ij,kj->k", slopes, event.carried_covariance, slopes)
    by_hold = HOLD_SHARE * np.gradient(event.run.rate)[window]
    by_model = event.systematic * event.run.rate[window]
    variance = by_parameters + event.by_inputs.rate[window] + by_hold**2 + by_model**2
    return np.asarray(np.sqrt(variance), np.float64)


def _volume(event: Resimulated, window: slice) -> float:
    return float(np.trapezoid(event.run.rate[window])) * event.interval


REMEMBERED = 16  # points; the oldest is forgotten
# Distances over which what is wrong with a model changes: of rail pressure [p_0], of the logarithm of the time the
# needle is open, and of the widest seat area.
REACH = (0.4, 0.7, 0.4)
EVENT_SHARE = 0.3  # variance, of what one event tells of its own point, over that between distant points
UNSEEN = 2e-3  # of a rate: standard deviation of what a learned model still gets wrong at a point far from all seen


class EventPoint(NamedTuple):
    """An event's: rail pressure [p_0] at its opening, logarithm of the time [s] open, widest normalised area."""

    rail_pressure: float
    open_time: float
    area: float


def operating_point(window: Window, interval: float) -> EventPoint:
    """That of an event; interval of its samples [s]."""
    area = window.inputs[:, 1]
    samples = max(int(np.count_nonzero(area > 0.0)), 1)
    return EventPoint(
        float(window.inputs[window.opening, 0]), math.log(samples * interval), float(np.max(area))
    )


def unfamiliarity(point: EventPoint, learned_at: Sequence[EventPoint]) -> float:
    """Share 0 .. 1 of a model's error at a point that events elsewhere leave open, 1 with none.

    By a Gaussian process of unit variance, whose covariance falls off with the squared distance over `REACH`:
    Rasmussen, Williams, Gaussian Processes for Machine Learning, equation (2.26).
    """
    if not learned_at:
        return 1.0
    points = np.array([*learned_at, point]) / REACH
    covariance = np.exp(-0.5 * np.sum((points[:, None, :] - points[None, :, :]) ** 2, axis=2))
    among, across = covariance[:-1, :-1], covariance[:-1, -1]
    told = across @ np.linalg.solve(among + EVENT_SHARE * np.eye(len(learned_at)), across)
    return math.sqrt(max(1.0 - float(told), 0.0))


def remembered(learned_at: Sequence[EventPoint], point: EventPoint) -> tuple[EventPoint, ...]:
    """The points with one more, the newest last."""
    return (*learned_at, point)[-REMEMBERED:]


class KnownFlow(NamedTuple):
    """Where the flow is known well enough: from and to which rail pressure [p_0], and up to which mean p_S / p_L."""

    rail_from: float
    rail_to: float
    filled_to: float


# Standard deviation of a flow, as a share, up to which it is known well enough: away from the event, where it may be
# larger than at the event by this factor in any case; and at the event.
FLOW_KNOWN, FURTHER, FLOW_LEARNED = 0.012, 1.3, 0.03
EVERYWHERE = KnownFlow(-math.inf, math.inf, math.inf)
NOWHERE = KnownFlow(math.inf, -math.inf, 0.0)
_LOWEST, _HIGHEST = 0.05, 2.5  # p_0, of any rail
_FILLED = 0.95  # p_S over p_L of a sac that is full
_LONG = 0.8  # the same, mean of a long injection
_LEAST_FLOW = 0.01  # of a nozzle as given: against a back-pressure above p_S there is none
_HALVINGS = 8


def known_flow(
    event: Resimulated, theta: NDArray[np.float64], covariance: NDArray[np.float64], point: EventPoint
) -> KnownFlow:
    """Where the flow is known by what is carried after an event, theta (m,) with the error covariance (m, m).

    Of what was injected it is known how it changes with theta. The fuller the sac, the more of that is the nozzle's
    doing: p_S / p_L = d ln Q_H / d ln (1 + N_H) of a steady flow. At another rail pressure N_H is another.
    """

    def by_nozzle(rail_pressure: float) -> NDArray[np.float64]:
        state = np.array([rail_pressure, 0.0, _FILLED * rail_pressure])
        change, slopes = nozzle_change(theta, state, np.array([rail_pressure, point.area]))
        return slopes / max(1.0 + change, _LEAST_FLOW)

    injected, full = float(event.run.rate.sum()), by_nozzle(point.rail_pressure)
    if not (injected > 0.0 and full[_NOZZLE] > 0.0):
        return NOWHERE
    here = event.run.slopes.sum(axis=0) / injected
    filled = min(max(here[_NOZZLE] / full[_NOZZLE], 0.0), _FILLED)

    def sigma(rail_pressure: float, fullness: float) -> float:
        share = (fullness - filled) / (1.0 - filled)
        slopes = here + share * (full - here) + fullness * (by_nozzle(rail_pressure) - full)
        return math.sqrt(max(slopes @ covariance @ slopes, 0.0))

    def enough(fullness: float) -> float:
        return max(FLOW_KNOWN, FURTHER * sigma(point.rail_pressure, fullness))

    if sigma(point.rail_pressure, filled) > FLOW_LEARNED:
        return NOWHERE
    filled_to = _last(lambda fullness: sigma(point.rail_pressure, fullness) <= enough(filled), filled, 1.0)
    fullness = filled if math.isfinite(filled_to) else max(filled, _LONG)
    most = enough(fullness)
    lowest, highest = (
        _last(lambda rail_pressure: sigma(rail_pressure, fullness) <= most, point.rail_pressure, limit)
        for limit in (_LOWEST, _HIGHEST)
    )
    return KnownFlow(lowest, highest, filled_to)


def _last(holds: Callable[[float], bool], first: float, limit: float) -> float:
    """The last number from `first`, where it holds, towards a limit, to some percent; infinite if it holds there."""
    if holds(limit):
        return math.copysign(math.inf, limit - first)
    beyond = limit
    for _ in range(_HALVINGS):
        middle = 0.5 * (first + beyond)
        first, beyond = (middle, beyond) if holds(middle) else (first, middle)
    return first
