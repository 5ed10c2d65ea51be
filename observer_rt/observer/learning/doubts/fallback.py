"""Falls back to the nominal model after events that are not explained, and stops learning at a wrong standstill."""

from collections.abc import Collection

from observer_rt.estimation.phases import Phase, PhaseStatistics
from observer_rt.observer.learning.doubts.adequacy import Objection, inadequate_phase
from observer_rt.observer.stream.state import Reason

FREEZE_AFTER = 2  # events
SET_ASIDE_AFTER = 2  # events
RELEASE_AFTER = 3
UNEXPLAINED = (
    Reason.MODEL_INADEQUATE,
    Reason.LIFT_SENSOR_LAG,
    Reason.AMBIGUOUS_SCALE,
    Reason.SUDDEN_CHANGE,
    Reason.TIME_BASE,
)
BELIEVED_AFTER = 2  # explained events in a row, where what was learned was set aside


class Mistrust:
    """What was learned is not carried where too many events are not explained by it.

    A sudden change is one such event, changes all the time are many; a scale that is not known is enough by itself.
    Until then an event that passed makes up for one that did not; afterwards several in a row must pass, for some
    operating points contradict a wrong model more than others.
    """

    def __init__(self) -> None:
        self._events = 0
        self._passed = 0
        self._because: Objection | None = None

    @property
    def lasts(self) -> bool:
        """Whether what was learned is set aside."""
        return self._because is not None

    def after(self, found: Collection[Objection]) -> Objection | None:
        """Take in what an event was found to be; why the nominal model is to be carried from it on, None if not."""
        unexplained = next((objection for objection in found if objection.reason in UNEXPLAINED), None)
        if unexplained is not None:
            counts = SET_ASIDE_AFTER if unexplained.reason is Reason.AMBIGUOUS_SCALE else 1
            self._events, self._passed = self._events + counts, 0
            if self._events >= SET_ASIDE_AFTER:
                self._because = unexplained
        elif not found:
            self._events, self._passed = max(self._events - 1, 0), self._passed + 1
            if self._passed >= BELIEVED_AFTER:
                self._events, self._because = 0, None
        return self._because


class Freezer:
    """Learning stops when the standstill contradicts the model twice, and goes on after three good events."""

    def __init__(self) -> None:
        self._bad = 0
        self._good = 0
        self._frozen = False

    def is_frozen_after(self, statistics: PhaseStatistics) -> bool:
        """Take in an event's pooled statistics; whether learning is frozen from it on."""
        if inadequate_phase(statistics) is Phase.STANDSTILL:
            self._bad, self._good = self._bad + 1, 0
        else:
            self._bad, self._good = 0, self._good + 1
        if self._bad >= FREEZE_AFTER:
            self._frozen = True
        elif self._good >= RELEASE_AFTER:
            self._frozen = False
        return self._frozen
