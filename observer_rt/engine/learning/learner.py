"""Learning between events: everything jointly, by prediction error, as a posterior over what an event may be."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from observer_rt.engine.estimation.parameters import Parameter, Theta
from observer_rt.engine.estimation.phases import no_statistics
from observer_rt.engine.estimation.predictor import NoiseLevels, Window, gain_schedule
from observer_rt.engine.learning.account import explain
from observer_rt.engine.learning.adequacy import Objection
from observer_rt.engine.learning.event import ClosedEvent, EventReader
from observer_rt.engine.learning.fit import theta_limits
from observer_rt.engine.learning.healthy import NOT_FITTED, Healthy
from observer_rt.engine.learning.knowledge import Adoption, Knowledge, LearnedInjector, LearningState, Outcome
from observer_rt.engine.learning.outcome import outcome_of
from observer_rt.engine.learning.verdict import first_objection
from observer_rt.engine.stream.standstill import Standstill, offset_between
from observer_rt.engine.stream.state import Constants, Reason

STANDSTILL_ENOUGH = 1000  # samples, for the first guess of the offset
OTHER_NOISE = 1.25  # times a level
SCHEDULES = 6  # gains that are kept: those of all hypotheses


class Learner:
    """Learns event after event. Pure: no clock, no thread; the caller decides where it runs."""

    def __init__(self, constants: Constants, knowledge: Knowledge, healthy: Healthy = NOT_FITTED) -> None:
        """constants: at the start; healthy: what the model leaves unexplained of a healthy injector."""
        gains_for = lru_cache(maxsize=SCHEDULES)(gain_schedule)
        c, interval, calibration = constants.coefficients, constants.interval, constants.calibration
        limits = theta_limits(c, constants.needle, healthy.shape is not None)
        self._reader = EventReader(interval, c.pressure_scale, limits, healthy, calibration, gains_for)
        self._constants = constants
        self.schedule = self._reader.gains(knowledge.in_force, knowledge.state.noise, constants)
        """Gains at the start."""
        state = knowledge.state.begun(constants.interval, healthy.overdispersion)
        self.state = state.map(lambda learned: learned.with_gain(constants.calibration.gain))
        """State after the last event."""

    def learn(
        self, window: Window, standstill: Standstill, in_force: Theta, constants: Constants | None = None
    ) -> Outcome:
        """Go on by one event, during which `in_force` (m,) was carried; its constants, None: as at the start.

        An event that cannot be read changes no more of the state than noise levels and standstill. Whatever its
        numbers are, and wherever they lead, it is refused at worst.
        """
        event = ClosedEvent(window, standstill, in_force, constants or self._constants)
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # refused for what it leads to
                outcome = _learned(self.state, event, self._reader)
        except (ArithmeticError, ValueError):  # LinAlgError is one
            outcome = _failed(self.state, event, Objection(Reason.NOT_LEARNED), self._reader)
        self.state = outcome.knowledge.state
        return outcome


def _learned(state: LearningState, event: ClosedEvent, reader: EventReader) -> Outcome:
    """Learn from one event; the outcome's knowledge has the state to go on from.

    Raises ArithmeticError, ValueError by impossible numbers.
    """
    window, standstill = event.window, event.standstill
    if standstill.noise is not None:
        state = _with_noise(state, standstill.noise)
    state = replace(state, held_rail=state.held_rail.after(window, standstill, event.constants.rail_every))
    objection = first_objection(state, event, reader)
    if objection is not None:
        return _failed(state, event, objection, reader)
    offset = offset_between(state.standstill, standstill)
    if standstill.samples >= STANDSTILL_ENOUGH and state.learned.is_prior:
        state = state.map(lambda learned: _with_first_offset(learned, standstill.offset))
    state = replace(state, standstill=standstill)
    return outcome_of(explain(state, event, offset, reader), event, reader)


def _with_noise(state: LearningState, noise: NoiseLevels) -> LearningState:
    """Sets the noise levels from an event on; statistics by levels that differ by much do not count on."""
    before = state.noise
    ratios = (noise.rail_pressure / before.rail_pressure, noise.line_pressure / before.line_pressure)
    if any(abs(math.log(ratio)) > math.log(OTHER_NOISE) for ratio in ratios):
        state = state.map(lambda learned: replace(learned, statistics=no_statistics()))
    return replace(state, noise=noise)


def _with_first_offset(learned: LearnedInjector, offset: float) -> LearnedInjector:
    """Where nothing was learned yet, the first event is explained from the offset at rest [p_0]."""
    mean, theta = learned.belief.mean.copy(), learned.theta.copy()
    mean[Parameter.LINE_PRESSURE_OFFSET] = theta[Parameter.LINE_PRESSURE_OFFSET] = offset
    return replace(learned, belief=replace(learned.belief, mean=mean), theta=theta)


def _failed(state: LearningState, event: ClosedEvent, objection: Objection, reader: EventReader) -> Outcome:
    """Outcome of an event that nothing was learned from."""
    return Outcome(
        adoption=Adoption.FAILED,
        knowledge=Knowledge(state, event.in_force),
        schedule=reader.gains(event.in_force, state.noise, event.constants),
        forward=(objection,),
        objections=(objection,),
        estimate=state.learned.theta,
        covariance=state.learned.gated.covariance,
    )
