"""Falls back to the nominal model after unexplained events, stops learning, and adopts only what does better.

What was just learned does better when x^ would have run better with it in the last events. Where a fault has passed,
what was believed before it does better than what was learned from it.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.learning.predictor import sum_of_squares
from observer_rt.engine.estimation.phases import Phase, PhaseStatistics
from observer_rt.engine.estimation.predictor import Setting, Window, open_loop_errors
from observer_rt.engine.estimation.scalars import Theta, learned_of
from observer_rt.engine.learning.adequacy import BELIEVED_AFTER, Objection, inadequate_phase
from observer_rt.engine.learning.disturbances.colour import Colour
from observer_rt.engine.stream.state import Reason

FREEZE_AFTER = 2  # events
SET_ASIDE_AFTER = 2  # events
RELEASE_AFTER = 3
RELAPSES = 3
RECOVERED = 4  # events in a row that passed, after which relapses no longer count
CHANGES = 5  # sudden ones, with no two events in a row that passed between, that an injector may have
UNEXPLAINED = (
    Reason.MODEL_INADEQUATE,
    Reason.LIFT_SENSOR_LAG,
    Reason.AMBIGUOUS_SCALE,
    Reason.SUDDEN_CHANGE,
    Reason.TIME_BASE,
)
TOLERANCE = 1.1  # by which a new theta may raise the re-simulated output error


@dataclass(frozen=True)
class Mistrust:
    """Count of events that what was learned does not explain; after too many of them it is not carried.

    A sudden change is one such event, changes all the time are many; a scale that is not known is enough by itself.
    Until then an event that passed makes up for one that did not; afterwards several in a row must pass, for some
    operating points contradict a wrong model more than others. So many changes meanwhile are none: the model does
    not fit. because: why what was learned is set aside, None: it is not.
    """

    events: int = 0
    passed: int = 0
    changes: int = 0
    because: Objection | None = None

    @property
    def lasts(self) -> bool:
        """Whether what was learned is set aside."""
        return self.because is not None

    def after(self, found: Collection[Objection]) -> "Mistrust":
        """Adds an event's objections."""
        unexplained = next((objection for objection in found if objection.reason in UNEXPLAINED), None)
        if unexplained is not None:
            changes = self.changes + any(objection.reason is Reason.SUDDEN_CHANGE for objection in found)
            events = self.events + (SET_ASIDE_AFTER if unexplained.reason is Reason.AMBIGUOUS_SCALE else 1)
            return Mistrust(events, 0, changes, unexplained if events >= SET_ASIDE_AFTER else self.because)
        if found:
            return self
        passed = self.passed + 1
        if passed >= BELIEVED_AFTER:
            return Mistrust(passed=passed)
        return replace(self, events=max(self.events - 1, 0), passed=passed)

    @property
    def objection(self) -> Objection | None:
        """Objection for which the nominal model is to be carried, None if it is not."""
        return self.because and self.reported([self.because])[0]

    def reported(self, found: Sequence[Objection]) -> tuple[Objection, ...]:
        """Objections to report of an event taken in, one change too many as a model that is inadequate."""
        if self.changes <= CHANGES:
            return tuple(found)
        inadequate = Objection(Reason.MODEL_INADEQUATE)
        return tuple(inadequate if each.reason is Reason.SUDDEN_CHANGE else each for each in found)


@dataclass(frozen=True)
class Relapses:
    """Count of the times that events contradicted the model anew, after some had passed.

    A fault passes. A model contradicted again and again is wrong, at the operating points that pass as well. passed:
    events in a row, RECOVERED at most.
    """

    count: int = 0
    passed: int = 0

    @property
    def last(self) -> bool:
        """Whether no event is believed."""
        return self.count >= RELAPSES

    def after(self, found: Collection[Objection]) -> "Relapses":
        """Adds an event's objections."""
        if any(objection.reason is Reason.MODEL_INADEQUATE for objection in found):
            return Relapses(self.count + (self.passed > 0), 0)
        if found:
            return self
        passed = min(self.passed + 1, RECOVERED)
        return Relapses(0 if passed == RECOVERED else self.count, passed)


@dataclass(frozen=True)
class Freezer:
    """Learning stops when the standstill contradicts the model twice, and goes on after three good events."""

    bad: int = 0
    good: int = 0
    frozen: bool = False

    def after(self, statistics: PhaseStatistics) -> "Freezer":
        """Adds an event's pooled statistics."""
        if inadequate_phase(statistics) is Phase.STANDSTILL:
            bad = self.bad + 1
            return Freezer(bad, 0, self.frozen or bad >= FREEZE_AFTER)
        good = self.good + 1
        return Freezer(0, good, self.frozen and good < RELEASE_AFTER)


@dataclass(frozen=True, eq=False)
class Rehearsed:
    """An event to run open loop.

    setting: during it; offset [p_0]: that it was found to have; errors: of the output (n,), by theta.
    """

    window: Window
    setting: Setting
    offset: float
    errors: dict[bytes, NDArray[np.float64]] = field(default_factory=dict)

    def error(self, theta: NDArray[np.float64], colour: Colour | None) -> float:
        """Sum of squared output errors from the opening on, x^ with theta (m,) following x~ up to there.

        Without the colour of the noise: hum may be larger than what an adoption changes. The offset, which may be
        another in every event and changes no rate, is what it was found to be.
        """
        window, key = self.window, theta.tobytes()
        if key not in self.errors:
            learned = learned_of(theta, self.setting.coefficients)._replace(offset=self.offset)
            self.errors[key] = open_loop_errors(window, self.setting, learned)
        errors = self.errors[key]
        if colour is not None:
            errors = colour.whitening.of(errors, window.masked)
        return sum_of_squares(errors[window.opening :])


def is_better(
    events: Sequence[Rehearsed],
    theta: NDArray[np.float64],
    in_force: NDArray[np.float64],
    colour: Colour | None,
) -> bool:
    """Whether a theta (m,) keeps the re-simulated output error of events down.

    Rail-pressure noise makes that error wander, so a better theta often raises it a little: asked to lower it
    strictly, the worst of 20 worn injectors stays 0.88 % off in mass, with this tolerance 0.45 %.
    """
    after, before = (_error(events, one, colour) for one in (theta, in_force))
    return after < TOLERANCE * before


def best_explaining(events: Sequence[Rehearsed], candidates: Sequence[Theta], colour: Colour | None) -> Theta:
    """The theta (m,) with the lowest re-simulated output error of events; of equal ones the first."""
    errors = [_error(events, theta, colour) for theta in candidates]
    return candidates[int(np.argmin(np.nan_to_num(errors, nan=np.inf)))]


def _error(events: Sequence[Rehearsed], theta: Theta, colour: Colour | None) -> float:
    return sum(event.error(theta, colour) for event in events)
