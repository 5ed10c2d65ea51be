"""Adequacy of a model: whether its residuals, by signal, phase and operating point, are noise alone."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from observer_rt.engine.estimation.phases import Phase
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy, healthy_for_naming
from observer_rt.identification.discovery.search.candidates import Candidate
from observer_rt.identification.discovery.search.fits import Fitter
from observer_rt.identification.discovery.search.results import Cell
from observer_rt.identification.likelihood.likelihood import JointLikelihood, JudgedModel
from observer_rt.identification.likelihood.signals import Pool, Signal, statistics_by_signal
from observer_rt.model.baseline import Baseline
from observer_rt.model.effective import EffectiveModel

VARIANCE_LIMIT = {Signal.LINE_PRESSURE: 1.25, Signal.INJECTION_RATE: 1.6}
COLOUR_LIMIT = {Signal.LINE_PRESSURE: 2.0, Signal.INJECTION_RATE: 4.0}
SIGNIFICANT_EXCESS = 5.0  # standard deviations beyond noise, from which on residuals are not noise alone
REMAINDER_SHARE = 0.06  # of what there was, that a fitted model may leave: a law is no more exact than it is
EXACT_SHARE = 1e-3  # of the same, that an exact model may leave: steps and samples are not finer
MOST_DELAY_SQUARE = 4.0  # mean square of the delays of shots that jitter, over their variance


def cells_of(likelihood: JointLikelihood, judged: Sequence[JudgedModel], model: EffectiveModel) -> tuple[Cell, ...]:
    """The map of residuals: a cell for every signal in every phase of every recording."""
    result = []
    for number, (recorded, judged_model) in enumerate(zip(likelihood.recordings, judged, strict=True)):
        measurement = recorded.measurement
        scale = {
            Signal.LINE_PRESSURE: float(np.exp(judged_model.log_sigma)) * model.coefficients.pressure_scale,
            Signal.INJECTION_RATE: measurement.rate_noise,
        }
        for signal, statistics in statistics_by_signal(recorded, judged_model).items():
            for phase in Phase:
                if statistics.samples[phase] == 0.0:
                    continue
                point = number, measurement.rail_pressure, measurement.duration, int(statistics.samples[phase])
                variance = statistics.variance(phase)
                figures = variance, statistics.colour(phase), statistics.excess(phase)
                result.append(Cell(signal, phase, *point, *figures, float(np.sqrt(variance)) * scale[signal]))
    return tuple(result)


def healthy_of_fit(baseline: Baseline, comparable: bool) -> Healthy:
    """The healthy injector as a fitted injector file knows it.

    Residuals of an inadequate fit do not count as the injector's, so that discovery searches them. comparable:
    whether the recordings have the sample rate of the fit, without which innovations differ; the sensor's offset
    holds anyway.
    """
    healthy, offset = baseline.healthy, baseline.healthy.line_pressure_offset_MPa if baseline.healthy else 0.0
    if not baseline.adequate:
        return Healthy(adequate=False, line_pressure_offset_MPa=offset)
    result = healthy_for_naming(healthy if healthy and comparable else baseline, comparable and healthy is not None)
    return replace(result, line_pressure_offset_MPa=offset)


def healthy_level(healthy: Healthy, signal: Signal, phase: Phase) -> tuple[float, float]:
    """Variance and colour of the healthy injector's innovations, at least those of noise alone."""
    if signal is Signal.LINE_PRESSURE:
        return float(healthy.variance[phase]), float(healthy.colour[phase].max())
    if healthy.rate is None:
        return 1.0, 1.0
    return max(1.0, healthy.rate.variance(phase)), max(1.0, healthy.rate.colour(phase))


@dataclass(frozen=True)
class Worst:
    """The signal and phase that a model explains worst; ratio: to the limit, above 1 for an inadequate model."""

    signal: Signal
    phase: Phase
    ratio: float


def worst(pool: Pool, healthy: Healthy = NOT_FITTED) -> Worst:
    """Signal and phase at which a model is least adequate; an excess below SIGNIFICANT_EXCESS counts as noise."""
    ranked = []
    for signal, statistics in pool.items():
        for phase in Phase:
            variance, colour = healthy_level(healthy, signal, phase)
            variance, colour = statistics.variance(phase) / variance, statistics.colour(phase) / colour
            ratio = max(variance / VARIANCE_LIMIT[signal], colour / COLOUR_LIMIT[signal])
            if statistics.excess(phase) < SIGNIFICANT_EXCESS:
                ratio = min(ratio, 1.0)
            ranked.append(Worst(signal, phase, ratio))
    return max(ranked, key=lambda item: item.ratio)


def most_explained(before: Pool, after: Pool) -> tuple[Phase, Signal]:
    """Where a model takes most away of the residuals that another leaves, by their squares."""
    places = [(phase, signal) for signal in before for phase in Phase]
    return max(places, key=lambda place: float((before[place[1]].squares - after[place[1]].squares)[place[0]]))


class Adequacy:
    """Adequacy of candidates: whether their residuals are noise, or errors that the fitted model has itself."""

    def __init__(self, fits: Fitter, healthy: Healthy) -> None:
        self._fits, self._healthy = fits, healthy
        self.remainder = REMAINDER_SHARE if healthy.appears else EXACT_SHARE
        """Share of the explained residuals that may be the model's own error."""

    def ratio(self, candidate: Candidate) -> float:
        """Ratio of a candidate's worst phase to its limit, above 1 if it does not explain the recordings."""
        return max(worst(self._fits.pool(candidate), self._healthy).ratio, self._lateness(candidate))

    def __call__(self, candidate: Candidate) -> bool:
        """Whether a candidate explains the recordings, up to the model's own error."""
        if self._lateness(candidate) > 1.0:
            return False
        return self.ratio(candidate) <= 1.0 or bool(candidate.ids and self._is_remainder(self._fits.pool(candidate)))

    def _lateness(self, candidate: Candidate) -> float:
        """Mean square delay of shots over its limit, above 1 if it is no jitter; 0 with a measured lift."""
        return max(judged.delay_square for judged in self._fits.judged(candidate)) / MOST_DELAY_SQUARE

    def _is_remainder(self, pool: Pool) -> bool:
        """Whether the residuals of every phase fell so far that the rest may be the model's own error."""
        before = self._fits.pool(self._fits.nothing())
        for signal, statistics in pool.items():
            for phase in Phase:
                healthy = VARIANCE_LIMIT[signal] * healthy_level(self._healthy, signal, phase)[0]
                excess = statistics.variance(phase) - healthy
                if excess > self.remainder * max(0.0, before[signal].variance(phase) - healthy):
                    return False
        return True
