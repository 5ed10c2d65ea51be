"""What is left unexplained, by signal, phase and operating point; and whether that is adequate."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from observer_rt.discovery.search.result import Cell
from observer_rt.estimation.phases import Phase, phase_statistics
from observer_rt.evidence.likelihood import Evidence, JudgedModel
from observer_rt.evidence.pooled import Pool, Signal, normalised, phases_by_signal
from observer_rt.model.baseline import Appearance, Baseline, HealthyRemainder, HealthyShape, PhaseFigures
from observer_rt.model.effective import EffectiveModel

VARIANCE_LIMIT = {Signal.LINE_PRESSURE: 1.25, Signal.INJECTION_RATE: 1.6}
COLOUR_LIMIT = {Signal.LINE_PRESSURE: 2.0, Signal.INJECTION_RATE: 4.0}
SIGNIFICANT = 5.0  # standard deviations


@dataclass(frozen=True)
class HealthyBaseline:
    """What the model leaves of the healthy injector: what counts is the difference from that.

    variance, colour: left in each phase; trusted: nothing is named on the healthy recordings; remainder: the shape of
    what is left and what effects it appears to be, None where nothing is known of it.
    """

    variance: Mapping[tuple[Signal, Phase], float]
    colour: Mapping[tuple[Signal, Phase], float]
    trusted: bool = True
    remainder: HealthyRemainder | None = None

    @property
    def shape(self) -> HealthyShape | None:
        """Mean innovation of the healthy injector, which is taken out of the evidence."""
        return None if self.remainder is None else self.remainder.shape

    @property
    def appears(self) -> Mapping[str, Appearance]:
        """What effects the healthy injector appears to have, by id."""
        return {} if self.remainder is None else self.remainder.appears


NO_BASELINE = HealthyBaseline({}, {})


def cells_of(evidence: Evidence, judged: Sequence[JudgedModel], model: EffectiveModel) -> tuple[Cell, ...]:
    """Every signal in every phase of every recording."""
    result = []
    for number, (trial, one) in enumerate(zip(evidence.trials, judged, strict=True)):
        measurement = trial.measurement
        scale = {
            Signal.LINE_PRESSURE: float(np.exp(one.log_sigma)) * model.coefficients.pressure_scale,
            Signal.INJECTION_RATE: measurement.rate_noise,
        }
        for signal, z in normalised(one).items():
            phases = phases_by_signal(trial)[signal]
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


def baseline_of(pool: Pool, remainder: HealthyRemainder, trusted: bool = True) -> HealthyBaseline:
    """The baseline that healthy recordings set; never below what noise alone leaves. pool: of the measured rate."""
    keys = [(Signal.INJECTION_RATE, phase) for phase in Phase if Signal.INJECTION_RATE in pool]
    line = _of_line(remainder.variance, remainder.colour)
    return HealthyBaseline(
        line[0] | {(s, p): max(1.0, pool[s].variance(p)) for s, p in keys},
        line[1] | {(s, p): max(1.0, pool[s].colour(p)) for s, p in keys},
        trusted,
        remainder,
    )


def baseline_of_fit(baseline: Baseline, comparable: bool) -> HealthyBaseline:
    """What a fitted injector file remembers; nothing is named by a model whose fit was not adequate.

    comparable: whether the recordings have the sample rate of the fit's, so that innovations mean the same.
    """
    healthy = baseline.healthy if comparable else None
    if healthy is None:
        return HealthyBaseline(*_of_line(baseline.variance, baseline.colour), trusted=False)
    return HealthyBaseline(*_of_line(healthy.variance, healthy.colour), baseline.adequate, healthy)


_Figures = dict[tuple[Signal, Phase], float]


def _of_line(variance: PhaseFigures, colour: PhaseFigures) -> tuple[_Figures, _Figures]:
    keys = [(Signal.LINE_PRESSURE, phase) for phase in Phase]
    return (
        {key: max(1.0, variance.at(key[1].name)) for key in keys},
        {key: max(1.0, colour.at(key[1].name)) for key in keys},
    )


@dataclass(frozen=True)
class Worst:
    """The signal and phase a model explains worst: how many times its limit (above 1: not adequate)."""

    signal: Signal
    phase: Phase
    ratio: float


def worst(pool: Pool, baseline: HealthyBaseline = NO_BASELINE) -> Worst:
    """Where the model is least adequate; what lies within SIGNIFICANT of noise counts as explained."""
    ranked = []
    for signal, statistics in pool.items():
        for phase in Phase:
            key = (signal, phase)
            variance = statistics.variance(phase) / baseline.variance.get(key, 1.0)
            colour = statistics.colour(phase) / baseline.colour.get(key, 1.0)
            ratio = max(variance / VARIANCE_LIMIT[signal], colour / COLOUR_LIMIT[signal])
            if statistics.excess(phase) < SIGNIFICANT:
                ratio = min(ratio, 1.0)
            ranked.append(Worst(signal, phase, ratio))
    return max(ranked, key=lambda item: item.ratio)
