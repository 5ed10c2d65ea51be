"""The state of learning after an event, as one frozen value: the account, and the trackers beside it.

Each tracker is a frozen class in a module of its own, with a method `after` that returns its next value, and is one
field here; the state file keeps it by the names of its fields. Nothing writes into the arrays.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from observer_rt.engine.estimation.gain import NoiseLevels
from observer_rt.engine.estimation.gating import prior_belief
from observer_rt.engine.estimation.scalars import SCALARS
from observer_rt.engine.learning.account.account import Account
from observer_rt.engine.learning.disturbances.clipping import EndsOfRange
from observer_rt.engine.learning.disturbances.coil_current import Energizing
from observer_rt.engine.learning.disturbances.colour import SlowRail, TimeJitter
from observer_rt.engine.learning.disturbances.held_rail import HeldRail
from observer_rt.engine.learning.disturbances.masks import OutlierSearch
from observer_rt.engine.learning.healthy import SAME_RATE
from observer_rt.engine.learning.learned_injector import LearnedInjector
from observer_rt.engine.learning.lift_lag import LiftLagSearch
from observer_rt.engine.learning.memory import NOT_KEPT, Count
from observer_rt.engine.learning.overdispersion import Overdispersion, of_healthy
from observer_rt.engine.learning.pressure_lag import LagDoubt, no_doubt
from observer_rt.engine.stream.standstill import Standstill


@dataclass(frozen=True, eq=False)
class LearningState:
    """All that goes from one event to the next."""

    account: Account  # hypotheses about the injector, with their probabilities
    noise: NoiseLevels
    lag_doubt: LagDoubt
    events: Count = 0  # learned from
    interval: float = 0.0  # of the samples [s]; 0 before the first event
    slow_rail: SlowRail = field(default_factory=SlowRail)
    jitter: TimeJitter = field(default_factory=TimeJitter)
    outliers: OutlierSearch = field(default_factory=OutlierSearch)
    range_ends: EndsOfRange = field(default_factory=EndsOfRange)
    overdispersion: Overdispersion = field(default_factory=Overdispersion)
    held_rail: HeldRail = field(default_factory=HeldRail)
    lift_lag: LiftLagSearch = field(default_factory=LiftLagSearch)
    energizing: Energizing = field(default_factory=Energizing)
    standstill: Standstill | None = field(default=None, metadata=NOT_KEPT)  # at the end of the last event

    @property
    def learned(self) -> LearnedInjector:
        """The injector as the hypothesis in force believes it to be."""
        return self.account.lead.learned

    def map(self, change: Callable[[LearnedInjector], LearnedInjector]) -> "LearningState":
        """State after a change of the injector in every hypothesis."""
        return replace(self, account=self.account.map(change))

    def begun(self, interval: float, overdispersion: float) -> "LearningState":
        """State to begin a run with, whose samples have this interval [s].

        With another interval the trackers begin anew, because they count in samples. overdispersion: of the healthy
        injector.
        """
        if math.isclose(self.interval, interval, rel_tol=SAME_RATE):
            return replace(self, standstill=None)
        return LearningState(
            account=Account.of(self.learned.begun(interval)),
            noise=self.noise,
            lag_doubt=no_doubt(SCALARS.width),
            events=self.events,
            interval=interval,
            overdispersion=of_healthy(overdispersion),
        )


def no_state(noise: NoiseLevels, pressure_scale: float) -> LearningState:
    """State before any event: phi = 0, with the prior. pressure_scale: p_0 [Pa]."""
    theta = np.zeros(SCALARS.width)
    belief = prior_belief(theta.copy(), np.diag(SCALARS.prior(pressure_scale) ** 2))
    return LearningState(Account.of(LearnedInjector(belief, theta)), noise, no_doubt(SCALARS.width))
