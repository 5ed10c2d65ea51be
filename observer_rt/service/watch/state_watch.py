"""Changes of state and reason as news, when they last."""

from observer_rt.observer.stream.state import Reason, State
from observer_rt.service.reports.news import Notice
from observer_rt.service.watch.arrivals import SECOND, Arrivals
from observer_rt.service.words import Topic, is_good, named

LASTING = 1.0  # s that a state must last to be told: a source that sends windows changes it at each of them
_ABOUT_INPUTS = (Reason.INPUT_TIMEOUT, Reason.INPUT_STALE, Reason.STARTING)


class StateWatch:
    """Tells what state the service is in, with the ages of the inputs where these are the reason."""

    def __init__(self, arrivals: Arrivals) -> None:
        self._arrivals = arrivals
        self._now: tuple[State, tuple[Reason, ...]] | None = None
        self._since = 0
        self._told: tuple[State, tuple[Reason, ...]] | None = None

    def look(self, now: int, state: tuple[State, tuple[Reason, ...]]) -> list[Notice]:
        """News at a time [ns]; state: with all its reasons."""
        if state != self._now:
            self._now, self._since = state, now
        if state == self._told or now - self._since < LASTING * SECOND:
            return []
        self._told = state
        what, why = state
        text = "; ".join([named(what), *map(named, why)])
        if not is_good(what) and any(reason in _ABOUT_INPUTS for reason in why):
            text += f"; {self._arrivals.as_text(now)}"
        return [Notice(Topic.STATE, text, is_good(what))]
