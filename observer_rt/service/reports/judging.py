"""Closed events on their way to the learner, and verdicts on their way to the stream."""

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.predictor import Window
from observer_rt.observer.judge import has_room, post_examined, post_learned
from observer_rt.observer.learning.doubts.adequacy import Innovations, Objection
from observer_rt.observer.learning.examiner import Examination, Examiner
from observer_rt.observer.learning.healthy import Healthy
from observer_rt.observer.learning.knowledge import Adoption, EventLearner, Knowledge, Outcome
from observer_rt.observer.observer import event_innovations, event_standstill, event_window, in_force
from observer_rt.observer.stream.phi import Phi
from observer_rt.observer.stream.state import INJECTIONS, PENDING_EVENTS, RING, Constants, Reason
from observer_rt.observer.stream.verdict import Taken
from observer_rt.service.compiled.by_reference import CompiledPipeline

PATIENCE = 0.5  # of the learning delay, after which an event is examined in case its learning is late


@dataclass(frozen=True)
class Fuel:
    """Fuel at a temperature [K] (None: as in the injector file), and the observer's constants with it."""

    temperature: float | None
    constants: Constants


@dataclass(eq=False)
class _Closed:
    """What is kept of a closed event until it is judged.

    number: in the order in which they closed, from 0; in_force: theta (m,) the observer carried; learning: what is
    being learned from it, None: nothing; examined: once it was; is_posted: the best verdict there will be is.
    """

    number: int
    fuel: Fuel
    window: Window | None
    innovations: Innovations
    in_force: NDArray[np.float64]
    learning: Future[Outcome] | None
    examined: Examination | None = None
    is_posted: bool = False


@dataclass(frozen=True, eq=False)
class Judged:
    """An event, `stream.state.EVENT`, that was judged.

    objections: what speaks against it; outcome: what was learned from it, None when nothing was; in_force: theta (m,)
    the observer carries now, phi: what its x^ carries; fuel: during the event.
    """

    event: np.void
    objections: tuple[Objection, ...]
    outcome: Outcome | None
    in_force: NDArray[np.float64]
    phi: Phi
    fuel: Fuel


class Judging:
    """Follows the stream: hands over every closed event once, posts verdicts, and tells what the stream took.

    The stream goes on meanwhile, in another thread, unless it waits for verdicts.
    """

    def __init__(
        self,
        compiled: CompiledPipeline,
        learner: EventLearner,
        executor: Executor,
        start: Knowledge,
        healthy: Healthy,
    ) -> None:
        """executor: runs one job at a time, in order; start: what is known before the first event.

        healthy: of the healthy injector.
        """
        self.known = start
        """All that was learned and judged so far."""
        self.rejected = 0
        """Outcomes that were not adopted."""
        self.late = 0
        """Outcomes that came too late and were left out."""
        self._compiled = compiled
        self._learner = learner
        self._executor = executor
        self._first_version = start.phi_version
        self._submitted = self._taken = 0
        self._carried = in_force(compiled.observer)
        self._waiting: deque[_Closed] = deque()
        interval = compiled.observer.constants.interval
        self._examiner = Examiner(start.statistics, healthy, start.colour_at(interval))

    @property
    def adoptions(self) -> int:
        """How often a new phi was adopted."""
        return self.known.phi_version - self._first_version

    @property
    def is_idle(self) -> bool:
        """Whether no closed event waits to be judged."""
        return not self._waiting

    def follow(self, learning: bool, fuel_temperature: float | None) -> Iterator[Judged]:
        """What the stream did since the last call: events that were judged, after handing over those that closed.

        learning: whether they are learned from.
        """
        memory = self._compiled.observer.memory[0]
        taken = int(memory["events_taken"])  # before the others: none is taken that has not closed
        closed = int(memory["events_closed"])
        while self._taken < taken or self._submitted < closed:
            if self._submitted < closed and self._event(self._submitted)["judged_before"] <= self._taken:
                self._submit(learning, fuel_temperature)
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
        """Post the verdicts that are known, on events that the stream will come to."""
        for place, closed in enumerate(self._waiting):
            if closed.is_posted or not has_room(self._compiled.observer, closed.number):
                continue
            if closed.learning is not None and closed.learning.done():
                self._post_learned(closed, closed.learning.result())
            elif place == 0 and closed.examined is None and self._is_pressing(closed):
                self._post_examined(closed)

    def _is_pressing(self, closed: _Closed) -> bool:
        """Whether an event is to be examined, which its predecessor must have been before."""
        observer = self._compiled.observer
        if closed.learning is None or observer.memory["waits_for_verdicts"][0]:
            return closed.learning is None
        newest = int(observer.ring[(int(observer.memory["processed"][0]) - 1) % RING]["index"])
        left = int(self._event(closed.number)["due_index"]) - newest
        return left < (1.0 - PATIENCE) * observer.constants.timing.learning_delay

    def _submit(self, learning: bool, fuel_temperature: float | None) -> None:
        observer, number = self._compiled.observer, self._submitted
        window = event_window(observer, number)
        learned = None
        if learning and window is not None:
            learned = self._executor.submit(
                self._learner.learn,
                window,
                event_standstill(observer, number),
                self._carried,
                observer.constants,
            )
        fuel = Fuel(fuel_temperature, observer.constants)
        innovations = event_innovations(observer, number)
        self._waiting.append(_Closed(number, fuel, window, innovations, self._carried, learned))
        self._submitted += 1

    def _post_examined(self, closed: _Closed) -> None:
        examiner = self._examiner
        closed.examined = examiner.examine(
            closed.window, closed.innovations, closed.in_force, closed.fuel.constants
        )
        is_coloured = examiner.colour is not None
        post_examined(self._compiled.observer, closed.number, closed.examined.objections, is_coloured)
        closed.is_posted = closed.learning is None

    def _post_learned(self, closed: _Closed, outcome: Outcome) -> None:
        is_coloured = outcome.knowledge.colour is not None
        post_learned(self._compiled.observer, closed.number, outcome, is_coloured)
        closed.is_posted = True

    def _judged(self) -> Judged:
        """The next event that the stream took, with the verdict that it found."""
        closed = self._waiting.popleft()
        self._taken += 1
        event = self._event(closed.number).copy()
        taken = Taken(int(event["taken"]))
        outcome: Outcome | None = None
        objections: tuple[Objection, ...] = (Objection(Reason.NOT_JUDGED),)
        if taken is Taken.LEARNED and closed.learning is not None:
            outcome = closed.learning.result()
            objections = outcome.objections
            self._adopt(outcome)
        elif taken is Taken.EXAMINED and closed.examined is not None:
            objections = closed.examined.objections
            self._examiner.statistics = closed.examined.statistics
        self.late += closed.learning is not None and outcome is None
        return Judged(event, objections, outcome, self._carried, self._compiled.observer.phi, closed.fuel)

    def _adopt(self, outcome: Outcome) -> None:
        knowledge = outcome.knowledge
        self._examiner.statistics = knowledge.statistics
        self._examiner.colour = knowledge.colour
        is_adopted = outcome.adoption is Adoption.ADOPTED
        self.rejected += not is_adopted
        self._carried = knowledge.in_force
        self.known = replace(knowledge, phi_version=self.known.phi_version + is_adopted)

    def _event(self, number: int) -> np.void:
        event: np.void = self._compiled.observer.memory[0]["events"][number % PENDING_EVENTS]
        return event

    def injections(self, judged: Judged) -> Iterator[np.void]:
        """The injections, `stream.state.INJECTION`, to be reported with an event."""
        memory = self._compiled.observer.memory[0]
        while memory["injections_reported"] < judged.event["injections"]:
            memory["injections_reported"] += 1
            yield memory["injections"][(int(memory["injections_reported"]) - 1) % INJECTIONS]
