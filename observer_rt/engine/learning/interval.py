"""Confidence intervals of injection rate and injected volume, from an event re-simulated."""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.model.needle import NeedleStroke
from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.estimation.predictor import (
    InputVariance,
    OpenLoop,
    Setting,
    Window,
    input_variance,
    open_loop,
)
from observer_rt.engine.estimation.scalars import Parameter
from observer_rt.engine.estimation.shot_delays import JITTER_SIZE, ShotDelays
from observer_rt.model.accuracy import EXACT, StatedAccuracy

# Error of the rate (one sigma) as a share of its change from sample to sample: between samples the inputs are not
# straight lines, least of all where the needle leaves its seat and comes back.
HOLD_SHARE = 0.06
# s (one sigma): uncertainty of the time at which two injections part, at the least flow between them.
PARTING = 20e-6


@dataclass(frozen=True)
class Resimulation:
    """An event re-simulated with the theta learned up to and from it, and the uncertainty of its rate."""

    run: OpenLoop  # over the event's window
    by_inputs: InputVariance  # variance by the noise of the inputs
    covariance: NDArray[np.float64]  # (m, m) of the error of the run's theta
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
    window: Window, setting: Setting, noise: NoiseLevels, theta: NDArray[np.float64], covariance: NDArray[np.float64]
) -> Resimulation:
    """Re-simulate an event with the theta (m,) learned from it, with an error covariance (m, m)."""
    run = open_loop(window, setting, theta)
    by_inputs = input_variance(window, run, setting, noise)
    return Resimulation(run, by_inputs, covariance, setting.interval)


def with_shots(event: Resimulation, window: Window, delays: ShotDelays) -> Resimulation:
    """An event whose shots answered commands, each by delays of its own, which go with theta and are known so well.

    What a delay moves is taken for the flow of its own shot.
    """
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


def rate_sigma(event: Resimulation, window: slice) -> NDArray[np.float64]:
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


def corrected_rate(event: Resimulation, window: slice) -> NDArray[np.float64]:
    """Rate [m3/s] at the samples of a window of the event, by its own pressures."""
    return np.asarray((1.0 + event.moved) * event.run.rate[window], np.float64)


def stroke_in(event: Resimulation, window: slice) -> NeedleStroke | None:
    """Stroke that lies in a window of the event, in s from its first sample on; None where the lift is recorded."""
    start, end = event.interval * window.start, event.interval * window.stop
    for stroke in event.strokes:
        if start < 0.5 * (stroke.opening + stroke.closed) < end:
            times = {
                name: getattr(stroke, name) - start for name in ("opening", "top", "closing", "closed", "landed")
            }
            return stroke._replace(**times)
    return None
