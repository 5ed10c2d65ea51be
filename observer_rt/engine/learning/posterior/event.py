"""One event, explained by all hypotheses of an account."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from observer_rt.core.learning.phases import phases_of
from observer_rt.engine.estimation.phases import AFTERGLOW, EDGE
from observer_rt.engine.estimation.prediction_error import EventCost, Linearisation
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.estimation.scalars import SCALARS, Parameter
from observer_rt.engine.learning.account.hypotheses import SETTLED, Possibility
from observer_rt.engine.learning.disturbances.noise_levels import Sigmas
from observer_rt.engine.learning.knowledge import LearningState
from observer_rt.engine.learning.learned_injector import LearnedInjector
from observer_rt.engine.learning.learned_range import EventPoint, operating_point
from observer_rt.engine.learning.posterior.believing import Believing, Continued, carried_on, noise_after
from observer_rt.engine.learning.posterior.explaining import Offers, Weighing, coming_back, offered
from observer_rt.engine.learning.posterior.reader import (
    ClosedEvent,
    EventReader,
    EventReading,
    Follows,
    setting_of,
)
from observer_rt.engine.learning.posterior.resting_pressure import RestingPressure, resting_pressure
from observer_rt.foundation.units import MEGAPASCAL

MOVED = 0.005 * MEGAPASCAL  # of offset or gain: beyond it an event is linearised anew
_SENSOR = (int(Parameter.LINE_PRESSURE_OFFSET), int(Parameter.LINE_PRESSURE_GAIN))


class ExplainedEvent(NamedTuple):
    """An event as far as it is understood.

    state: before it, but for what was seen of the range's ends; recorded: its window; unmasked: without the coil;
    window: without outliers, too; explanations: the likeliest first; carried: those that are carried on, the leading
    one first.
    """

    state: LearningState
    recorded: Window
    unmasked: Window
    window: Window
    point: EventPoint
    explanations: list[Continued]
    carried: list[Continued]

    @property
    def fault_weight(self) -> float:
        """Probability that the event is at fault, or the model inadequate."""
        return sum(explanation.weight for explanation, _ in self.explanations if not explanation.is_good)


def explain(
    state: LearningState, event: ClosedEvent, offset: float | None, reader: EventReader
) -> ExplainedEvent:
    """Explain an event; offset: line over rail pressure at rest before it [p_0], None: unknown.

    Raises numpy.linalg.LinAlgError where nothing is finite.
    """
    window = unmasked = state.energizing.current.undone(event.window)
    likeliest = sorted(state.account.hypotheses, key=lambda each: -each.log_weight)
    reads = _Reads(state, event, window, offset, reader)
    for hypothesis, offers in zip(likeliest, offered(likeliest), strict=True):
        reads.weigh(hypothesis, offers)
    if likeliest[0].learned.is_prior:
        reads.weigh_coloured(likeliest[0])
    for hypothesis in coming_back(state.account, reader):
        reads.weigh(hypothesis, {SETTLED: hypothesis.log_weight})
    explanations = reads.weighing.explanations()
    state, window = reads.state, reads.window
    lead = next((i for i, each in enumerate(explanations) if each.is_good), None)
    if lead is not None:  # it is carried, and run again
        explanations[lead] = explanations[lead].fitted(reader)
    point = operating_point(window, reader.interval)
    believing = Believing(reader, state, point)
    continued = [(each, believing.after(each)) for each in explanations]
    return ExplainedEvent(state, event.window, unmasked, window, point, continued, carried_on(continued))


class _Reads:
    """An event read by hypothesis after hypothesis; what stands out by the first reading does not count in any."""

    def __init__(
        self,
        state: LearningState,
        event: ClosedEvent,
        window: Window,
        offset: float | None,
        reader: EventReader,
    ) -> None:
        self.state, self.window = state, window
        self._event, self._offset, self._reader = event, offset, reader
        self._phases = phases_of(window, round(EDGE / reader.interval), round(AFTERGLOW / reader.interval))
        self._readings: list[EventReading] = []
        self.weighing = Weighing(reader)

    def weigh(self, hypothesis: Possibility, offers: Offers) -> None:
        """Explain the event by a hypothesis, where that is finite. Raises numpy.linalg.LinAlgError when singular."""
        learned = hypothesis.learned
        steps = self._reader.limits.longest_step
        reading = next((each for each in self._readings if each.is_near(learned, steps)), None)
        if reading is None:
            reading = self._read(learned)
            if not np.isfinite(reading.first.value):
                return
            if not self._readings and not learned.is_prior:  # else there is nothing to stand out from
                sigmas = reading.follows.sigmas_in(learned)
                self.state, masked = self._reader.masked(self.state, self.window, reading.innovations, sigmas)
                if masked is not self.window:
                    self.window = masked
                    reading = self._read(learned)
            self._readings.append(reading)
        self.weighing.add(hypothesis, reading, offers)

    def weigh_coloured(self, hypothesis: Possibility) -> None:
        """Explain the event in the colour that noise at rest shows in it, where nothing is known of it before."""
        fit = self.weighing.fit_of(hypothesis)
        if fit is None:
            return
        reader, first = self._reader, self._readings[0]
        colour = noise_after(hypothesis.learned, self.window, fit.unfiltered, first.follows, reader).colour
        if colour is not None and hypothesis.learned.colour is None:
            coloured = replace(hypothesis.learned, colour=colour, theta=fit.linearisation.theta)
            hypothesis = replace(hypothesis, learned=coloured)
            self.weigh(hypothesis, *offered([hypothesis]))

    def _read(self, learned: LearnedInjector) -> EventReading:
        """Reads the event round what a hypothesis believes."""
        state, event, reader, offset = self.state, self._event, self._reader, self._offset
        schedule = reader.gains(learned.theta, state.noise, event.constants)
        follows = Follows(
            setting_of(event.constants, schedule),
            Sigmas(schedule.innovation_sigma, state.noise.line_pressure / reader.pressure_scale),
            offset,
        )
        cost = reader.cost_of(state, learned, self.window, follows)
        first, resting = self._linearised(learned, cost)
        return EventReading(
            learned,
            self.window,
            schedule,
            follows,
            cost,
            first,
            cost.innovations,
            cost.unfiltered,
            cost.slopes,
            self._phases,
            reader.healthy,
            resting,
        )

    def _linearised(self, learned: LearnedInjector, cost: EventCost) -> tuple[Linearisation, RestingPressure]:
        """Linearises a cost at the belief, with offset and gain as rest says where these are others."""
        reader, window = self._reader, self.window
        first = cost.linearised(learned.theta)
        resting = resting_pressure(window, cost, learned.theta, reader.interval, reader.pressure_scale)
        move = resting.held(learned.belief).prior.mean - learned.belief.mean
        move[list(SCALARS.gate.columns)] = 0.0
        if np.abs(move[list(_SENSOR)]).max() * reader.pressure_scale < MOVED:
            return first, resting
        first = cost.linearised(learned.theta + move)
        return first, resting_pressure(window, cost, first.theta, reader.interval, reader.pressure_scale)
