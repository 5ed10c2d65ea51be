"""What is wrong now: which message or state, since when, what to do, in the words of docs/operating.md."""

from dataclasses import dataclass

from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.output_messages import StatusValues
from observer_rt.observer.stream.state import Reason, State
from observer_rt.service.watch.arrivals import SECOND, Arrivals, message_text
from observer_rt.service.watch.input_watch import LASTING
from observer_rt.service.watch.silence import TOLD
from observer_rt.service.words import REASONS, STATES, TOPICS, Topic, is_good

_NO_DAEMON = "start `observer-rt run` for this bench, or see to its bus"


@dataclass(frozen=True)
class Fault:
    """Something that is wrong since a moment [ns since 1970]."""

    what: str
    since: int
    remedy: str


class FaultWatch:
    """Looks at one injector's messages and status now and then."""

    def __init__(self, bus: BusMap, arrivals: Arrivals) -> None:
        self._bus = bus
        self._arrivals = arrivals
        self._condition: tuple[int, int] | None = None
        self._since = 0

    def look(self, now: int, status: StatusValues | None) -> tuple[Fault, ...]:
        """All that is wrong at a time [ns since 1970], the likely cause first."""
        return (*self._silences(now), *self._said(now, status))

    def _silences(self, now: int) -> list[Fault]:
        """Messages that stay away."""
        arrivals = self._arrivals
        silent = [
            Fault(
                f"{source.text}: no frame for {arrivals.silence(source, now):.0f} s",
                now - round(arrivals.silence(source, now) * SECOND),
                TOPICS[Topic.INPUT].remedy,
            )
            for source in arrivals.sources
            if arrivals.silence(source, now) > max(TOLD, source.patience)
        ]
        since = arrivals.last_result(self._bus.status.layout)
        if now - since > TOLD * SECOND:
            text = message_text(self._bus, self._bus.status.layout)
            silent.insert(0, Fault(f"{text}: no frame for {(now - since) / SECOND:.0f} s", since, _NO_DAEMON))
        return silent

    def _said(self, now: int, status: StatusValues | None) -> list[Fault]:
        """What the observer says of itself."""
        if status is None:
            return []
        state, reason = State(int(status.state)), Reason(int(status.reason))
        if (state, reason) != self._condition:
            self._condition, self._since = (state, reason), now
        if is_good(state) or now - self._since < LASTING * SECOND:
            return []
        words = REASONS[reason] if reason is not Reason.NONE else STATES[state]
        name = reason.name if reason is not Reason.NONE else state.name
        return [Fault(f"{name}: {words.what}", self._since, words.remedy)]
