"""Tests residuals for adequacy, by signal, phase and operating point, and finds what they depend on.

Where the best model still fails, an equation is violated, and the excess depends on something: both are named.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.phases import Phase, phase_statistics
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy, healthy_for_naming
from observer_rt.identification.discovery.search.results import Candidate, Cell, Unexplained
from observer_rt.identification.likelihood.likelihood import (
    JointLikelihood,
    JudgedModel,
    Pool,
    Signal,
    normalised,
    phases_by_signal,
)
from observer_rt.model.baseline import Baseline
from observer_rt.model.effective import EffectiveModel

VARIANCE_LIMIT = {Signal.LINE_PRESSURE: 1.25, Signal.INJECTION_RATE: 1.6}
COLOUR_LIMIT = {Signal.LINE_PRESSURE: 2.0, Signal.INJECTION_RATE: 4.0}
SIGNIFICANT = 5.0  # standard deviations
BLOCK = 8  # samples whose mean is looked at
MATTERS = 0.1  # of the largest standardised slope, below which a dependence is not named
NAMES = ("rail pressure", "needle lift", "injection rate", "duration")


def cells_of(
    likelihood: JointLikelihood, judged: Sequence[JudgedModel], model: EffectiveModel
) -> tuple[Cell, ...]:
    """Every signal in every phase of every recording."""
    result = []
    for number, (recorded, one) in enumerate(zip(likelihood.recordings, judged, strict=True)):
        measurement = recorded.measurement
        scale = {
            Signal.LINE_PRESSURE: float(np.exp(one.log_sigma)) * model.coefficients.pressure_scale,
            Signal.INJECTION_RATE: measurement.rate_noise,
        }
        for signal, z in normalised(one).items():
            phases = phases_by_signal(recorded)[signal]
            statistics = phase_statistics(z, 1.0, phases, 0)
            for phase in Phase:
                if not (phases == phase).any():
                    continue
                result.append(
                    Cell(
                        signal,
                        phase,
                        number,
                        measurement.rail_pressure,
                        measurement.duration,
                        int(statistics.samples[phase]),
                        statistics.variance(phase),
                        statistics.colour(phase),
                        statistics.excess(phase),
                        float(np.sqrt(statistics.variance(phase))) * scale[signal],
                    )
                )
    return tuple(result)


def healthy_of_fit(baseline: Baseline, comparable: bool) -> Healthy:
    """Reads what a fitted injector file remembers; nothing is named by a model whose fit was not adequate.

    comparable: whether the recordings have the sample rate of the fit's, so that innovations mean the same.
    """
    healthy = baseline.healthy if comparable else None
    return healthy_for_naming(healthy or baseline, baseline.adequate and healthy is not None)


def healthy_level(healthy: Healthy, signal: Signal, phase: Phase) -> tuple[float, float]:
    """Variance and colour of the healthy injector's innovations, never below what noise alone leaves."""
    if signal is Signal.LINE_PRESSURE:
        return float(healthy.variance[phase]), float(healthy.colour[phase].max())
    if healthy.rate is None:
        return 1.0, 1.0
    return max(1.0, healthy.rate.variance(phase)), max(1.0, healthy.rate.colour(phase))


@dataclass(frozen=True)
class Worst:
    """The signal and phase a model explains worst: how many times its limit (above 1: not adequate)."""

    signal: Signal
    phase: Phase
    ratio: float


def worst(pool: Pool, healthy: Healthy = NOT_FITTED) -> Worst:
    """Signal and phase at which the model is least adequate; within SIGNIFICANT of noise counts as explained."""
    ranked = []
    for signal, statistics in pool.items():
        for phase in Phase:
            variance, colour = healthy_level(healthy, signal, phase)
            variance, colour = statistics.variance(phase) / variance, statistics.colour(phase) / colour
            ratio = max(variance / VARIANCE_LIMIT[signal], colour / COLOUR_LIMIT[signal])
            if statistics.excess(phase) < SIGNIFICANT:
                ratio = min(ratio, 1.0)
            ranked.append(Worst(signal, phase, ratio))
    return max(ranked, key=lambda item: item.ratio)


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Scaled means of blocks of residuals (b,), and what they may depend on (b, names)."""

    means: NDArray[np.float64]
    regressors: NDArray[np.float64]


def unexplained(
    likelihood: JointLikelihood,
    judged: Sequence[JudgedModel],
    nominal: EffectiveModel,
    place: Worst,
    fitted: Sequence[Candidate],
) -> Unexplained:
    """Describes the residuals in the phase and signal a model explains worst.

    The equation is that of the effect which explains most when nothing explains all.
    """
    blocks = _blocks(likelihood, judged, nominal, place)
    depends_on = _dependence(blocks)
    singles = [one for one in fitted if len(one.hypothesis.effects) == 1]
    leading = min(singles, key=lambda one: one.statistic).hypothesis.effects[0]
    sign = "more" if float(np.mean(blocks.means)) > 0.0 else "less"
    what = "line pressure" if place.signal is Signal.LINE_PRESSURE else "injection rate"
    term = f"measured {what} is {sign} than modelled"
    if depends_on:
        term += f"; the difference changes with {' and '.join(depends_on)}"
    return Unexplained(leading.equation, place.phase, place.signal, depends_on, term)


def _blocks(
    likelihood: JointLikelihood, judged: Sequence[JudgedModel], nominal: EffectiveModel, place: Worst
) -> _Blocks:
    means, regressors = [], []
    for recorded, one in zip(likelihood.recordings, judged, strict=True):
        at_line = place.signal is Signal.LINE_PRESSURE
        z = one.z if at_line else one.rate_z[:-1]
        phases = recorded.phases if at_line else recorded.rate_phases
        lift, rate = recorded.lift_and_rate(nominal, at_line)
        chosen = np.flatnonzero(phases == place.phase)
        for block in np.split(chosen, np.flatnonzero(np.diff(chosen) > 1) + 1):
            for first in range(0, block.size - BLOCK + 1, BLOCK):
                rows = block[first : first + BLOCK]
                means.append(float(z[rows].sum()) / np.sqrt(BLOCK))
                measurement = recorded.measurement
                regressors.append(
                    (measurement.rail_pressure, lift[rows].mean(), rate[rows].mean(), measurement.duration)
                )
    return _Blocks(np.array(means), np.array(regressors).reshape(-1, len(NAMES)))


def _dependence(blocks: _Blocks) -> tuple[str, ...]:
    """Names of what the means of blocks depend on, most important first: significant standardised slopes."""
    spread = blocks.regressors.std(axis=0) if len(blocks.means) else np.zeros(len(NAMES))
    varying = np.flatnonzero(spread > 1e-9 * np.abs(blocks.regressors).max(axis=0, initial=0.0))
    if len(blocks.means) <= varying.size + 1 or varying.size == 0:
        return ()
    centred = blocks.regressors[:, varying] - blocks.regressors[:, varying].mean(axis=0)
    design = np.column_stack((np.ones(len(blocks.means)), centred / spread[varying]))
    slopes, *_ = np.linalg.lstsq(design, blocks.means, rcond=None)
    left = blocks.means - design @ slopes
    variance = max(1.0, float(left @ left) / (len(left) - design.shape[1]))
    sigma = np.sqrt(np.diag(np.linalg.pinv(design.T @ design)) * variance)
    size, sigma = np.abs(slopes[1:]), sigma[1:]
    important = [
        i for i in np.argsort(-size) if size[i] > SIGNIFICANT * sigma[i] and size[i] > MATTERS * size.max()
    ]
    return tuple(NAMES[varying[i]] for i in important)
