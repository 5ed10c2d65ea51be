"""Holds what learning knows after an event, as one frozen value: what was learned, and what is followed beside it.

A value that is followed from event to event is a frozen class of its own module, with a method `after`, and one field
here; a file then keeps it by the names of its fields. Nothing writes into the arrays.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.estimation.gating import Belief, prior_belief
from observer_rt.engine.estimation.phases import PhaseStatistics, no_statistics
from observer_rt.engine.estimation.scalars import SCALARS, Theta
from observer_rt.engine.learning.adequacy import SETTLED
from observer_rt.engine.learning.disturbances.clipping import EndsOfRange
from observer_rt.engine.learning.disturbances.coil_current import Energizing
from observer_rt.engine.learning.disturbances.colour import Colour, RestingNoise, SlowRail, TimeJitter
from observer_rt.engine.learning.disturbances.held_rail import HeldRail
from observer_rt.engine.learning.disturbances.masks import OutlierSearch
from observer_rt.engine.learning.disturbances.pressure_gains import PressureGains
from observer_rt.engine.learning.fallback import Freezer, Mistrust, Rehearsed, Relapses
from observer_rt.engine.learning.healthy import SAME_RATE
from observer_rt.engine.learning.learned_range import EventPoint
from observer_rt.engine.learning.lift_lag import LiftLagSearch
from observer_rt.engine.learning.memory import NOT_KEPT, Count
from observer_rt.engine.learning.overdispersion import Overdispersion, of_healthy
from observer_rt.engine.learning.pressure_lag import LagDoubt, SlowedSensor, no_doubt
from observer_rt.engine.learning.trend import Trend
from observer_rt.engine.stream.standstill import Standstill


@dataclass(frozen=True, eq=False)
class LearnedInjector:
    """Estimate of injector and noise.

    belief: about all parameters jointly; theta (m,): where the last event was explained; statistics: of recent
    innovations; active: the gated columns in use; is_prior: nothing was learned yet, or all of it was forgotten;
    colour: of the innovations, None while they are white.
    """

    belief: Belief
    theta: Theta
    statistics: PhaseStatistics
    active: frozenset[int]
    is_prior: bool
    colour: Colour | None = None

    def colour_at(self, interval: float) -> Colour | None:
        """The colour, if it was found at this sample interval [s]."""
        colour = self.colour
        if colour is None or not math.isclose(colour.interval, interval, rel_tol=SAME_RATE):
            return None
        return colour


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """Estimate when SETTLED events in a row had passed: a passing fault leaves the injector as it was.

    learned: None, while so many never did; failed: events since, passed: in a row.
    """

    learned: LearnedInjector | None = None
    gains: PressureGains = field(default_factory=PressureGains)
    at_rest: RestingNoise = field(default_factory=RestingNoise)
    failed: int = 0
    passed: int = 0

    @property
    def is_worth_trying(self) -> bool:
        """Whether the next event may be explained by it and not by what is believed now: takes twice as long."""
        return self.learned is not None and self.failed > 0 and self.passed == 0

    def after(
        self, learned: LearnedInjector, gains: PressureGains, at_rest: RestingNoise, has_passed: bool
    ) -> "Checkpoint":
        """Adds an event; learned, gains, at_rest: after it."""
        if not has_passed:
            return replace(self, failed=self.failed + 1, passed=0)
        if self.passed + 1 < SETTLED:
            return replace(self, passed=self.passed + 1)
        return Checkpoint(learned, gains, at_rest, 0, self.passed + 1)


@dataclass(frozen=True, eq=False)
class LearningState:
    """All that goes from one event to the next.

    noise: levels in use; passed_with: theta (m,) in force after the last event that passed; events: learned from;
    learned_at: the operating points of the last of them; interval: of the samples [s], 0 before any; standstill: when
    the last event ended; last_event: to be run open loop with a new theta.
    """

    learned: LearnedInjector
    noise: NoiseLevels
    passed_with: Theta
    lag_doubt: LagDoubt
    events: Count = 0
    learned_at: tuple[EventPoint, ...] = ()
    interval: float = 0.0
    checkpoint: Checkpoint = field(default_factory=Checkpoint)
    gains: PressureGains = field(default_factory=PressureGains)
    at_rest: RestingNoise = field(default_factory=RestingNoise)
    slow_rail: SlowRail = field(default_factory=SlowRail)
    jitter: TimeJitter = field(default_factory=TimeJitter)
    outliers: OutlierSearch = field(default_factory=OutlierSearch)
    range_ends: EndsOfRange = field(default_factory=EndsOfRange)
    trend: Trend = field(default_factory=Trend)
    overdispersion: Overdispersion = field(default_factory=Overdispersion)
    held_rail: HeldRail = field(default_factory=HeldRail)
    freezer: Freezer = field(default_factory=Freezer)
    mistrust: Mistrust = field(default_factory=Mistrust)
    relapses: Relapses = field(default_factory=Relapses)
    slowed: SlowedSensor = field(default_factory=SlowedSensor)
    lift_lag: LiftLagSearch = field(default_factory=LiftLagSearch)
    energizing: Energizing = field(default_factory=Energizing)
    standstill: Standstill | None = field(default=None, metadata=NOT_KEPT)
    last_event: Rehearsed | None = field(default=None, metadata=NOT_KEPT)

    @property
    def unseen_variance(self) -> NDArray[np.float64]:
        """Variances (m,) of theta beside those of the belief: by what gains and lag of the sensors may be."""
        return self.gains.wear_variance(self.learned.theta.size) + self.lag_doubt.variance

    def begun(self, in_force: Theta, interval: float, overdispersion: float) -> "LearningState":
        """State to go on with, in a run that carries `in_force` (m,) and has samples of an interval [s].

        What was followed in samples of another one is followed anew. overdispersion: of the healthy injector.
        """
        learned = replace(self.learned, theta=in_force, colour=self.learned.colour_at(interval))
        if math.isclose(self.interval, interval, rel_tol=SAME_RATE):
            return replace(self, learned=learned, standstill=None, last_event=None)
        return LearningState(
            learned=learned,
            noise=self.noise,
            passed_with=in_force,
            lag_doubt=no_doubt(in_force.size),
            events=self.events,
            learned_at=self.learned_at,
            interval=interval,
            overdispersion=of_healthy(overdispersion),
        )


def no_state(noise: NoiseLevels, pressure_scale: float) -> LearningState:
    """State before any event: phi = 0 and the prior. pressure_scale p_0 [Pa]."""
    theta = np.zeros(SCALARS.width)
    belief = prior_belief(np.zeros(SCALARS.width), np.diag(SCALARS.prior(pressure_scale) ** 2))
    learned = LearnedInjector(belief, theta, no_statistics(), frozenset(), is_prior=True)
    return LearningState(learned, noise, theta, no_doubt(SCALARS.width))
