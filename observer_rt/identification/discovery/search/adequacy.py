"""Adequacy of a model: whether its residuals are noise alone, also at operating points held out."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from observer_rt.core.learning.whitening import robust_cost
from observer_rt.engine.estimation.phases import Phase
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy, healthy_for_naming
from observer_rt.foundation.units import Floats
from observer_rt.identification.discovery.search.candidates import Candidate, CandidateKey, sizing
from observer_rt.identification.discovery.search.fits import Fitter
from observer_rt.identification.discovery.search.results import Cell, CellKey, Discovery
from observer_rt.identification.likelihood.bounded_fit import fit
from observer_rt.identification.likelihood.excerpts import every_second_point
from observer_rt.identification.likelihood.likelihood import JointLikelihood, JudgedModel, RecordingLikelihood
from observer_rt.identification.likelihood.open_loop import pressure_gap, simulated
from observer_rt.identification.likelihood.signals import Pool, Signal, statistics_by_signal
from observer_rt.model.baseline import Baseline
from observer_rt.model.effect import Component, Effect, Equation
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.parameters import LineOutflow

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
    """The healthy injector as a fitted file knows it; discovery searches the residuals of an inadequate fit instead.

    comparable: the recordings have the sample rate of the fit, else innovations differ.
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


class HeldOutPoints:
    """Candidates fitted to every second operating point and judged on the events of the others."""

    def __init__(self, likelihood: JointLikelihood, nominal: EffectiveModel) -> None:
        recordings = likelihood.recordings
        halves = every_second_point([recorded.measurement for recorded in recordings])
        self._fitted, self._judged = (JointLikelihood([recordings[i] for i in half]) for half in halves)
        self._nominal = nominal
        self._cache: dict[CandidateKey, _Events | None] = {}

    def statistic(self, candidate: Candidate) -> float:
        """-2 log L of all events held out; inf without a solution, nan if nothing is held out."""
        if not self._judged.recordings:
            return math.nan
        events = self._events(candidate)
        return math.inf if events is None else float(np.sum(events.statistic))

    def sizes(self, candidate: Candidate) -> tuple[float, ...]:
        """Sizes fitted to every second operating point; to all points if nothing is held out."""
        events = self._events(candidate) if self._judged.recordings else None
        return candidate.sizes if events is None else tuple(events.theta.tolist())

    def gap(self, candidate: Candidate) -> float:
        """Rms of the line pressure's open-loop gap on the events held out [Pa]; nan without any."""
        if not self._judged.recordings:
            return math.nan
        events = self._events(candidate)
        return math.inf if events is None else math.sqrt(float(np.mean(events.gap)))

    def pays(self, candidate: Candidate, smaller: Candidate) -> bool:
        """Whether a candidate explains the events held out better than a smaller one; true if nothing is held out.

        -2 log L must fall by more than its scatter. Users want a small open-loop gap: it may grow by its scatter.
        """
        if not self._judged.recordings:
            return True
        after, before = self._events(candidate), self._events(smaller)
        if after is None or before is None:
            return before is None and after is not None
        fall, scatter = _sum_with_scatter(before.statistic - after.statistic)
        gap_fall, gap_scatter = _sum_with_scatter(before.gap - after.gap)
        return fall > scatter and gap_fall > -gap_scatter

    def _events(self, candidate: Candidate) -> "_Events | None":
        if candidate.key not in self._cache:
            self._cache[candidate.key] = self._judge(candidate)
        return self._cache[candidate.key]

    def _judge(self, candidate: Candidate) -> "_Events | None":
        hypothesis, theta = candidate.hypothesis, candidate.theta
        if hypothesis.effects:
            refitted = fit(sizing(self._fitted, self._nominal, hypothesis), theta, hypothesis.ranges())
            if refitted is None:
                return None
            theta = refitted.theta
        model = hypothesis.model(self._nominal, theta)
        judged = self._judged.judge(model)
        if judged is None:
            return None
        recordings = self._judged.recordings
        statistic = [_statistic_by_event(*pair) for pair in zip(recordings, judged, strict=True)]
        measured = [recorded.measurement for recorded in recordings]
        gap = [float(np.mean(pressure_gap(one, run) ** 2)) for one in measured for run in simulated(one, model)]
        return _Events(theta, np.concatenate(statistic), np.array(gap))


@dataclass(frozen=True, eq=False)
class _Events:
    theta: Floats  # (p,) fitted to the other events
    statistic: Floats  # (events,) -2 log L
    gap: Floats  # (events,) mean square of the line pressure's open-loop gap [Pa2]


def _sum_with_scatter(values: Floats) -> tuple[float, float]:
    """Sum of values (events,), and its standard deviation by their scatter, which is 0 for a single event."""
    scatter = float(np.std(values, ddof=1)) * math.sqrt(values.size) if values.size > 1 else 0.0
    return float(np.sum(values)), scatter


def _statistic_by_event(recorded: RecordingLikelihood, judged_model: JudgedModel) -> Floats:
    """-2 log L of the events of a recording (events,); the part of a measured rate is divided among them evenly."""
    sizes = np.array([event.end - event.counted for event in recorded.measurement.events])
    beyond = np.array([2.0 * robust_cost(judged_model.z, first, 1.0) for first in [0, *np.cumsum(sizes).tolist()]])
    of_rate = robust_cost(judged_model.rate_z, 0, 1.0) + judged_model.rate_z.size * judged_model.rate_log_sigma
    return np.asarray(beyond[:-1] - beyond[1:] + 2.0 * sizes * judged_model.log_sigma + 2.0 * of_rate / sizes.size)


@dataclass(frozen=True)
class Disagreement:
    """A cell of the map with the nominal model, and with what was found or is nearest."""

    before: Cell
    after: Cell
    equation: Equation | None  # violated; None where `before` does not disagree significantly, or nobody knows


def disagreements(
    discovery: Discovery, shown: Candidate, likelihood: JointLikelihood, nominal: EffectiveModel
) -> tuple[Disagreement, ...]:
    """The map, in the order of the recordings. shown: what was found; if nothing, the nearest candidate counts."""
    cells = discovery.after
    if shown.ids != discovery.best.ids and shown.ids:
        model = shown.model(nominal)
        judged = likelihood.judge(model)
        cells = () if judged is None else cells_of(likelihood, judged, model)
    after = {cell.key: cell for cell in cells}
    equations = _equations(discovery, shown, likelihood, nominal)
    result = []
    for cell in discovery.before:
        equation = equations.get(cell.key) if cell.excess > SIGNIFICANT_EXCESS else None
        result.append(Disagreement(cell, after.get(cell.key, cell), equation))
    return tuple(result)


def _equations(
    discovery: Discovery, shown: Candidate, likelihood: JointLikelihood, nominal: EffectiveModel
) -> dict[CellKey, Equation]:
    """For every cell the equation of that effect without which the cell is explained worst."""
    if not shown.ids and discovery.unexplained is not None:
        return {cell.key: discovery.unexplained.equation for cell in discovery.before}
    worst: dict[CellKey, tuple[float, Equation]] = {}
    for effect in shown.hypothesis.effects:
        others, sizes = shown.without(effect)
        model = others.model(nominal, sizes)
        judged = likelihood.judge(model)
        for cell in discovery.before if judged is None else cells_of(likelihood, judged, model):
            if cell.key not in worst or cell.variance > worst[cell.key][0]:
                worst[cell.key] = cell.variance, _violated(effect, nominal)
    return {key: equation for key, (_, equation) in worst.items()}


def _violated(effect: Effect, model: EffectiveModel) -> Equation:
    if effect.component is Component.NOZZLE and model.injector.line_outflow is LineOutflow.SEAT:
        return Equation.SAC_PRESSURE  # the nozzle flow is in no other
    return effect.equation
