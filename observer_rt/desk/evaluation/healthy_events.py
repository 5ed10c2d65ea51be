"""The remainder that the observer's own x~, unlike the predictor of `fit`, leaves of a healthy injector; its laws."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from observer_rt.config.bench import Bench, BenchInjector, load_bench
from observer_rt.config.injector_sections import Meaning, SamplingConfig
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.engine.estimation.parameters import Parameter, Theta
from observer_rt.engine.estimation.phases import Phase, no_statistics
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.adequacy import Innovations, event_statistics
from observer_rt.engine.learning.event import with_smooth_rail
from observer_rt.engine.learning.healthy import NOT_FITTED, EventStretch, ShapeFit, stretch_of
from observer_rt.engine.learning.knowledge import Knowledge, Outcome, TemperedEvent, overdispersion_of
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.learning.run import EventCost
from observer_rt.engine.reports.learned_laws import LearnedLaw
from observer_rt.engine.stream.standstill import Standstill
from observer_rt.engine.stream.state import Constants
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import Floats
from observer_rt.model.baseline import Baseline, HealthyRemainder, PhaseFigures
from observer_rt.model.parameters import InjectorParameters

OUTLIER = 8.0  # standard deviations
_DIGITS = 5


@dataclass(frozen=True, eq=False)
class _HealthyEvent:
    cost: EventCost
    whitened: EventCost  # as the learner weighs it: by the colour of the noise
    theta: Theta  # (m,) of the healthy injector, its sensor's offset as at rest
    covariance: Floats  # (m, m) of the belief before the event


class _Listener(Learner):
    def __init__(self, events: list[_HealthyEvent], _: BenchInjector, constants: Constants, start: Knowledge) -> None:
        super().__init__(constants, start)
        self._events = events
        events.clear()  # those of a run whose lift failed, and which is done again without it

    def learn(
        self, window: Window, standstill: Standstill, in_force: Theta, constants: Constants | None = None
    ) -> Outcome:
        theta = np.zeros_like(in_force)
        theta[Parameter.LINE_PRESSURE_OFFSET] = standstill.offset
        covariance = self.state.learned.belief.covariance
        outcome = super().learn(window, standstill, in_force, constants)
        during, state = constants or self._constants, outcome.knowledge.state
        setting, sigma = self.reader.setting_at(outcome.estimate, state.noise, during)
        cost = EventCost(with_smooth_rail(window, during), setting, sigma, self.reader.burn_in)
        self._events.append(_HealthyEvent(cost, cost.whitened_by(state.learned.colour), theta, covariance))
        return outcome


def observer_remainder(
    injector: InjectorParameters, baseline: Baseline | None, recordings: Sequence[Recording]
) -> HealthyRemainder | None:
    """Remainder that the observer leaves of healthy recordings; None where it judged no event of them.

    baseline: what else its fit states. Recordings at another sample rate than the first one's are left out. Raises
    `UserError` as `evaluate`.
    """
    rate = recordings[0].sample_rate
    fitted = injector.model_copy(update={"baseline": baseline})
    bench, collected = bench_of(fitted, recordings[0]), list[list[_HealthyEvent]]()
    knowledge: Knowledge | None = None
    for recording in recordings:
        if recording.sample_rate != rate:
            continue
        events: list[_HealthyEvent] = []
        uncommanded = replace(recording, energizing=None)  # its pilot valve goes by the lift, as in the fit
        knowledge = evaluate(bench, [uncommanded], knowledge, learner_of=partial(_Listener, events)).knowledge
        if events:
            collected.append(events)
    return _remainder(collected) if collected else None


def learn_laws(injector: InjectorParameters, recordings: Sequence[Recording]) -> tuple[LearnedLaw, ...]:
    """Laws of nozzle and seat that the network learns from recordings; none where the observer refuses them."""
    alike = [recording for recording in recordings if recording.sample_rate == recordings[0].sample_rate]
    try:
        return evaluate(bench_of(injector, alike[0]), alike).evaluations[-1].learned
    except UserError:
        return ()


def bench_of(injector: InjectorParameters, recording: Recording) -> Bench:
    """The example's bench as a recording was made, on which the injector is learned with whatever its fit says."""
    bench = load_bench().with_parameters(injector)
    sampling = SamplingConfig(rate_hz=recording.sample_rate, meaning=recording.meaning or Meaning.INSTANT)
    learning = bench.injector.config.learning.model_copy(update={"on_inadequate_model": True})
    return bench.with_sections(sampling=sampling, learning=learning)


def _remainder(collected: Sequence[Sequence[_HealthyEvent]]) -> HealthyRemainder:
    seen = [[_innovations(event) for event in events] for events in collected]
    first = collected[0][0]
    fit = ShapeFit(seen, first.cost.sigma * first.cost.setting.coefficients.pressure_scale)
    statistics, tempered = [], []
    for number, events in enumerate(collected):
        shape = fit.shape(number if len(collected) > 1 else None)
        total = no_statistics()
        for event in events:
            run = replace(event.whitened, shape=shape).linearised(event.theta)
            tempered.append(TemperedEvent(run, event.covariance))
            innovations, interval = Innovations(run.innovations, event.whitened.sigma), event.cost.setting.interval
            total = total.faded(1.0, event_statistics(event.cost.window, innovations, interval, NOT_FITTED))
        statistics.append(total)
    return HealthyRemainder(
        variance=PhaseFigures.of({p.name: max(statistic.variance(p) for statistic in statistics) for p in Phase}),
        colour=PhaseFigures.of({p.name: max(statistic.colour(p) for statistic in statistics) for p in Phase}),
        overdispersion=round(overdispersion_of(tempered), _DIGITS),
        shape=fit.shape(),
    )


def _innovations(event: _HealthyEvent) -> tuple[EventStretch, Floats]:
    """Normalised, an outlier counting for little."""
    cost, setting = event.cost, event.cost.setting
    z = np.clip(cost.innovations(event.theta) / cost.sigma, -OUTLIER, OUTLIER)
    z[: cost.burn_in] = 0.0
    return stretch_of(cost.window, setting.coefficients, setting.interval), z
