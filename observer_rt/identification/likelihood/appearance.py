"""Apparent sizes of effects on a healthy injector, and the smallest sizes that show, both by signatures."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from observer_rt.engine.estimation.phases import Phase, phase_statistics
from observer_rt.engine.learning.healthy import NOT_FITTED, EventStretch, Healthy, ShapeFit, together
from observer_rt.foundation.units import Floats
from observer_rt.identification.likelihood.likelihood import JointLikelihood, JudgedModel, residuals_of
from observer_rt.identification.likelihood.measurement import Measurement, expected_of, stretches
from observer_rt.model.baseline import Appearance, HealthyRemainder, PhaseFigures
from observer_rt.model.effect import Effect
from observer_rt.model.effective import EffectiveModel

VISIBLE_GAIN = 25.0  # of -2 log L that a size must gain to be visible: 5 standard deviations
VISIBLE_GAIN_OF_FIT = 36.0  # what a fitted model leaves of a healthy injector gains up to 30 now and then
PROBES = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)  # sizes over the dead zone, tried until an effect is visible
LEAST_INFORMATION = 1e-3  # of the largest information: a recording that has less on an effect is left out
_DIGITS = 5


@dataclass(frozen=True, eq=False)
class Signature:
    """Change of the residuals of every recording by a size of an effect, as a line through 0."""

    effect: Effect
    size: float  # SI
    information: Floats  # (recordings,) squared length of the change
    gain: Floats  # (recordings,) product of the change with the residuals

    @property
    def sigma(self) -> float:
        """Standard deviation of the size by noise alone, all recordings together [SI]."""
        return self.size / math.sqrt(float(np.sum(self.information)))


Judge = Callable[[Effect, tuple[float, ...]], list[JudgedModel] | None]
"""A model with an effect of these sizes more, on every recording; None without a solution."""


def signature_of(
    effect: Effect, judged: Sequence[JudgedModel], judge: Judge, remaining: Sequence[JudgedModel] | None = None
) -> Signature | None:
    """Signature of an effect at the smallest visible probe, else the last that changes something; None if none does.

    remaining: residuals that the gains are of, where they are others than those of `judged`.
    """
    if not effect.parameters:
        return None
    probed, others = effect.parameters[0], effect.parameters[1:]
    signature = None
    for probe in PROBES:
        size = probe * probed.dead_zone
        size = size if size <= probed.highest else -size
        moved = judge(effect, (size, *(p.starts[0] for p in others)))
        if moved is None or not probed.lowest <= size <= probed.highest:
            break
        before, after, left = (
            [residuals_of([recording]).z for recording in models] for models in (judged, moved, remaining or judged)
        )
        changes = [z_before - z_after for z_before, z_after in zip(before, after, strict=True)]
        information = np.array([float(change @ change) for change in changes])
        gain = np.array([float(change @ z) for change, z in zip(changes, left, strict=True)])
        if float(np.sum(information)) > 0.0:
            signature = Signature(effect, abs(size), information, math.copysign(1.0, size) * gain)
        if float(np.sum(information)) > VISIBLE_GAIN:
            break
    return signature


def healthy_remainder(
    likelihood: JointLikelihood, model: EffectiveModel, effects: Sequence[Effect], remembered: Healthy = NOT_FITTED
) -> HealthyRemainder:
    """Residuals of a model on healthy recordings: their shape, and apparent effects beyond the shape.

    Each recording is compared with the others' shape, so that appearances hold at any operating point. remembered: by
    an earlier fit, with the shape that the likelihood subtracts. Raises ArithmeticError without a finite solution.
    """
    judged = likelihood.judge(model)
    if judged is None:
        raise ArithmeticError("the model has no finite solution on the healthy recordings")
    measured = [recorded.measurement for recorded in likelihood.recordings]
    sigmas = [math.exp(recording.log_sigma) * model.coefficients.pressure_scale for recording in judged]
    events = [_by_event(measurement, recording.z) for measurement, recording in zip(measured, judged, strict=True)]
    fit = ShapeFit(events, float(np.mean(sigmas)))
    several = len(measured) > 1
    remaining = [
        replace(recording, z=recording.z - expected_of(fit.shape(number if several else None), measurement) / sigma)
        for number, (recording, measurement, sigma) in enumerate(zip(judged, measured, sigmas, strict=True))
    ]
    signatures = [
        signature_of(effect, judged, lambda tried, sizes: likelihood.judge(tried.apply(model, sizes)), remaining)
        for effect in effects
    ]
    statistics = [
        phase_statistics(recording.z, 1.0, recorded.phases, 0)
        for recorded, recording in zip(likelihood.recordings, remaining, strict=True)
    ]
    return HealthyRemainder(
        line_pressure_offset_MPa=remembered.line_pressure_offset_MPa,
        variance=PhaseFigures.of({p.name: max(recorded.variance(p) for recorded in statistics) for p in Phase}),
        colour=PhaseFigures.of({p.name: max(recorded.colour(p) for recorded in statistics) for p in Phase}),
        appears={seen.effect.id: _appearance(seen) for seen in signatures if seen is not None},
        shape=fit.shape() if remembered.shape is None else together(remembered.shape, fit.shape()),
    )


def _by_event(measurement: Measurement, z: Floats) -> list[tuple[EventStretch, Floats]]:
    parts = stretches(measurement)
    ends = np.cumsum([part.samples for part in parts])
    return list(zip(parts, np.split(z, ends[:-1]), strict=True))


def _appearance(signature: Signature) -> Appearance:
    """Mean size over the recordings, its uncertainty, and its scatter between the recordings beyond noise."""
    seen = signature.information > LEAST_INFORMATION * np.max(signature.information)
    size, weights = signature.size, signature.information[seen] / signature.size**2
    apparent, total = size * signature.gain[seen] / signature.information[seen], float(np.sum(weights))
    mean = float(weights @ apparent) / total
    if len(weights) == 1:
        scatter = abs(mean)  # nothing says how it changes with the operating point
    else:
        beyond_noise = float(weights @ (apparent - mean) ** 2) - (len(weights) - 1)
        scatter = math.sqrt(max(0.0, beyond_noise / (total - float(weights @ weights) / total)))
    uncertainty = math.sqrt(1.0 / total + scatter**2 * float(weights @ weights) / total**2)
    first = signature.effect.parameters[0]
    mean, uncertainty, scatter = (float(f"{value / first.si:.{_DIGITS}g}") for value in (mean, uncertainty, scatter))
    return Appearance(mean=mean, uncertainty=uncertainty, scatter=scatter, unit=first.unit)


def reference(appears: Mapping[str, Appearance], signature: Signature) -> tuple[float, float]:
    """Mean and sigma [SI] of an effect's size on the healthy injector, as its signature weighs recordings, or 0."""
    apparent = appears.get(signature.effect.id)
    if apparent is None:
        return 0.0, 0.0
    weights = signature.information
    by_recordings = float(weights @ weights) / float(np.sum(weights)) ** 2
    si = signature.effect.parameters[0].si
    return apparent.mean * si, si * math.hypot(apparent.uncertainty, apparent.scatter * math.sqrt(by_recordings))


def least_gain(appears: Mapping[str, Appearance]) -> float:
    """Least gain of -2 log L by which an effect counts. appears: effects the healthy injector seems to have."""
    return VISIBLE_GAIN_OF_FIT if appears else VISIBLE_GAIN


def smallest_visible(appears: Mapping[str, Appearance], signature: Signature) -> float:
    """Size [SI] from which on an effect is distinguished from noise and from the healthy injector."""
    least = math.sqrt(least_gain(appears)) * math.hypot(signature.sigma, reference(appears, signature)[1])
    return max(least, signature.effect.parameters[0].dead_zone)
