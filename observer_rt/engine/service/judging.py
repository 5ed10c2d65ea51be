"""Closed events on their way to the learner, and verdicts on their way to the stream."""

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from observer_rt.core.stream.stream import INJECTIONS, PENDING_EVENTS
from observer_rt.engine.estimation.predictor import Window
from observer_rt.engine.learning.adequacy import Examination, Examiner, Innovations, Objection
from observer_rt.engine.learning.healthy import Healthy
from observer_rt.engine.learning.knowledge import Adoption, EventRecord, Knowledge, Outcome
from observer_rt.engine.learning.learner import Learner
from observer_rt.engine.mailbox import has_room, post_examined, post_learned
from observer_rt.engine.observer import event_innovations, event_standstill, event_window
from observer_rt.engine.service.messages import CompiledPipeline
from observer_rt.engine.stream.standstill import Standstill, resting_lift_of
from observer_rt.engine.stream.state import Constants, Reason, VerdictKind
from observer_rt.engine.stream.validity import until_learned


@dataclass(eq=False)
class _PendingEvent:
    number: int  # in the order in which they closed, from 0
    constants: Constants
    window: Window | None
    standstill: Standstill | None  # until it ended; None: nothing is to be learned
    innovations: Innovations
    knowledge: Knowledge  # that the observer carried
    learning: Future[Outcome] | None = None  # the job that learns from it
    examined: Examination | None = None  # once it was
    earlier: Outcome | None = None  # what was learned from an earlier one
    objections: tuple[Objection, ...] = ()  # to it, or to what was learned
    is_taken: bool = False

    @property
    def is_learned(self) -> bool:
        """Whether learning from it has ended."""
        return self.learning is not None and self.learning.done()

    @property
    def information(self) -> float:
        """Information of the event about the injector, in no particular unit: the square of the flow, summed up."""
        if self.window is None:
            return 0.0
        rail_pressure, area = self.window.inputs.T
        return float(np.sum(rail_pressure * np.maximum(area, 0.0) ** 2))


class InlineExecutor(Executor):
    """Learns in lockstep: runs each job at once, in the caller's thread."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Call `fn` and return its finished future."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class Judging:
    """Follows the stream: hands over every closed event once, posts verdicts, and returns what the stream took.

    The stream goes on meanwhile, in another thread, unless it waits for verdicts.
    """

    def __init__(
        self,
        compiled: CompiledPipeline,
        learner: Learner,
        executor: Executor,
        start: Knowledge,
        healthy: Healthy,
        on_failure: Callable[[Exception], None],
    ) -> None:
        """executor: runs one job at a time, in order; on_failure: called with an error that learning raised."""
        self.knowledge = start
        """All that was learned and judged so far."""
        self.rejected = 0
        """Outcomes that were not adopted."""
        self.late = 0
        """Outcomes that came too late for their event and were put into force with a later one."""
        self.passed_over = 0
        """Events that were judged and not learned from, since more came than can be learned from."""
        self.on_learned: Callable[[], None] = lambda: None
        """Called by the executor when something was learned, for whoever waits to `post`."""
        self._compiled = compiled
        memory = compiled.observer.memory  # stays where it is: views spare a look-up a frame
        self._events_closed = memory["counts"]["events_closed"]
        self._events_taken = memory["judgement"]["events_taken"]
        self._events = compiled.observer.events
        self._waits_for_verdicts = memory["mode"]["waits_for_verdicts"]
        self._learner = learner
        self._on_failure = on_failure
        self._executor = executor
        self._first_version = start.phi_version
        self._submitted = self._taken = 0
        self._waiting: deque[_PendingEvent] = deque()
        self._learned_from: _PendingEvent | None = None
        self._next: _PendingEvent | None = None
        self._late: Outcome | None = None  # to be put into force with the next event
        learned, interval = start.state.learned, compiled.observer.constants.interval
        self._examiner = Examiner(learned.statistics, healthy, learned.colour_at(interval))

    @property
    def adoptions(self) -> int:
        """Number of adoptions of a new phi."""
        return self.knowledge.phi_version - self._first_version

    @property
    def is_idle(self) -> bool:
        """Whether no closed event waits to be judged."""
        return not self._waiting

    def follow(self, learning: bool) -> Iterator[EventRecord]:
        """Follows the stream since the last call: events judged, after handing over those that closed."""
        taken = int(self._events_taken[0])  # before the others: none is taken that has not closed
        closed = int(self._events_closed[0])
        while self._taken < taken or self._submitted < closed:
            if self._submitted < closed and self._event(self._submitted)["judged_before"] <= self._taken:
                self._submit(learning)
            else:
                yield self._judged()

    def answer(self) -> None:
        """Post the verdict on the event that the stream waits for; when it is being learned from, wait for that."""
        closed = self._waiting[0]
        if closed.learning is None:
            self._post_examined(closed)
        else:
            self._post_learned(closed, closed.learning.result())

    def post(self) -> None:
        """Post known verdicts on events that the stream will come to; none where it waits for them.

        All are examined once their predecessors were taken: a pause of the source hides how late their learning is.
        """
        if self._waits:
            return
        self._end_learning()
        if not self._waiting:
            return
        first = self._waiting[0]
        if first.examined is None and not first.is_learned and not self._would_be_taken(first):
            self._post_examined(first)

    @property
    def _waits(self) -> bool:
        """True if the stream waits for verdicts: then every event is learned from."""
        return bool(self._waits_for_verdicts[0])

    def _would_be_taken(self, closed: _PendingEvent) -> bool:
        """True if the stream would take the first verdict on an event learned from, being due already.

        It is due where only the next window showed that it was over, until the event after it has closed.
        """
        event = self._event(closed.number)
        is_due = event["closed_index"] > event["due_index"]
        return bool(closed.learning is not None and is_due and self._submitted == closed.number + 1)

    def _submit(self, learning: bool) -> None:
        observer, number = self._compiled.observer, self._submitted
        window = event_window(observer, number)
        closed = _PendingEvent(
            number,
            observer.constants,
            window,
            event_standstill(observer, number) if learning and window is not None else None,
            event_innovations(observer, number),
            self.knowledge,
        )
        self._waiting.append(closed)
        self._submitted += 1
        if closed.standstill is None:
            return
        if self._waits or self._learned_from is None:
            self._learn(closed)
        elif self._next is None or closed.information >= self._next.information:
            self.passed_over += self._next is not None
            self._next = closed
        else:
            self.passed_over += 1

    def _learn(self, closed: _PendingEvent) -> None:
        assert closed.window is not None
        assert closed.standstill is not None
        self._learned_from = closed
        closed.learning = self._executor.submit(
            self._learner.learn, closed.window, closed.standstill, closed.knowledge.in_force, closed.constants
        )
        closed.learning.add_done_callback(lambda _: self.on_learned())

    def _end_learning(self) -> None:
        """Hands what was learned to its event, or to the next if that was taken; then the next learning."""
        closed = self._learned_from
        if closed is None or not closed.is_learned:
            return
        assert closed.learning is not None
        failure = closed.learning.exception()
        if isinstance(failure, Exception):
            closed.learning = None
            self._on_failure(failure)
        elif closed.is_taken or not has_room(self._compiled.observer, closed.number):
            self._late = closed.learning.result()
        else:
            self._post_learned(closed, closed.learning.result())
        self._learned_from = None
        if self._next is not None:
            self._learn(self._next)
            self._next = None

    def _post_examined(self, closed: _PendingEvent) -> None:
        examiner, in_force = self._examiner, closed.knowledge.in_force
        closed.examined = examiner.examine(closed.window, closed.innovations, in_force, closed.constants)
        closed.earlier, self._late = self._late, None
        objections = closed.examined.objections
        if closed.standstill is not None:
            objections = tuple(replace(each, reason=until_learned(each.reason)) for each in objections)
        closed.objections = objections or (closed.earlier.forward if closed.earlier else ())
        colour = closed.earlier.knowledge.state.learned.colour if closed.earlier else examiner.colour
        post_examined(self._compiled.observer, closed.number, closed.objections, colour is not None, closed.earlier)

    def _post_learned(self, closed: _PendingEvent, outcome: Outcome) -> None:
        self._late = None  # this knows of it
        is_coloured = outcome.knowledge.state.learned.colour is not None
        post_learned(self._compiled.observer, closed.number, outcome, is_coloured)

    def _judged(self) -> EventRecord:
        """The next event that the stream took, with the verdict that it found."""
        closed = self._waiting.popleft()
        closed.is_taken = True
        self._taken += 1
        event = self._event(closed.number).copy()
        objections: tuple[Objection, ...] = (Objection(Reason.NOT_JUDGED),)
        outcome: Outcome | None = None
        taken = VerdictKind(int(event["taken"]))
        if taken is VerdictKind.LEARNED and closed.learning is not None:
            outcome = closed.learning.result()
            objections = outcome.objections
            self._examiner.take(Examination(outcome.forward, outcome.knowledge.state.learned.statistics))
            self._put_into_force(outcome, event)
        elif taken is VerdictKind.EXAMINED and closed.examined is not None:
            objections = closed.objections
            self._examiner.take(closed.examined)
            if closed.earlier is not None:
                self._put_into_force(closed.earlier, event)
        elif closed.earlier is not None:
            self._late = closed.earlier
        if outcome is None and closed.learning is not None:
            self.late += 1  # it was taken before what is learned from it was known, or just before that was posted
            if closed is not self._learned_from and closed.is_learned:
                self._late = closed.learning.result()
        is_late = closed.standstill is not None and outcome is None
        return EventRecord(event, objections, outcome, is_late, self.knowledge, closed.constants)

    def _put_into_force(self, outcome: Outcome, event: np.void) -> None:
        """Puts knowledge into force from the judgement of an event, `stream.state.EVENT`, on."""
        knowledge = outcome.knowledge
        self._examiner.colour = knowledge.state.learned.colour
        is_adopted = outcome.adoption is Adoption.ADOPTED
        self.rejected += not is_adopted
        scale = self._compiled.observer.constants.coefficients.pressure_scale
        self.knowledge = replace(
            knowledge, phi_version=self.knowledge.phi_version + is_adopted, lift=resting_lift_of(event, scale)
        )

    def _event(self, number: int) -> np.void:
        event: np.void = self._events[number % PENDING_EVENTS]
        return event

    def injections(self, judged: EventRecord) -> Iterator[np.void]:
        """The injections, `stream.state.INJECTION`, to be reported with an event."""
        counts = self._compiled.observer.memory[0]["counts"]
        while counts["injections_reported"] < judged.event["injections"]:
            counts["injections_reported"] += 1
            yield self._compiled.observer.injections[(int(counts["injections_reported"]) - 1) % INJECTIONS]
