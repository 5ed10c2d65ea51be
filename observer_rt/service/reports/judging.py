"""Closed events on their way to the learner, and what was learned from them on its way into force."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.predictor import Window
from observer_rt.observer.learning.doubts.adequacy import Innovations, Objection
from observer_rt.observer.learning.examiner import Examiner
from observer_rt.observer.learning.healthy import Healthy
from observer_rt.observer.learning.knowledge import Adoption, Knowledge, Outcome
from observer_rt.observer.observer import (
    event_innovations,
    event_standstill,
    event_window,
    in_force,
    judge,
)
from observer_rt.observer.stream.phi import Phi
from observer_rt.observer.stream.state import INJECTIONS, PENDING_EVENTS, Constants
from observer_rt.service.compiled.by_reference import CompiledPipeline
from observer_rt.service.reports.worker import Training


@dataclass(frozen=True)
class Fuel:
    """Fuel at a temperature [K] (None: as in the injector file), and the observer's constants with it."""

    temperature: float | None
    constants: Constants


@dataclass(frozen=True, eq=False)
class _Closed:
    """What is kept of a closed event until it is judged; in_force: theta (m,) the observer carried."""

    fuel: Fuel
    window: Window | None
    innovations: Innovations
    in_force: NDArray[np.float64]


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
    """Hands over every closed event once, and judges them in order."""

    def __init__(
        self, compiled: CompiledPipeline, training: Training, start: Knowledge, healthy: Healthy
    ) -> None:
        """start: what is known before the first event; healthy: of the healthy injector."""
        self.known = start
        """All that was learned and judged so far."""
        self.rejected = 0
        """Outcomes that were not adopted."""
        self._compiled = compiled
        self._closed = compiled.observer.memory["events_closed"]
        self._training = training
        self._first_version = start.phi_version
        self._submitted = 0
        self._waiting: deque[_Closed] = deque()
        interval = compiled.observer.constants.interval
        self._examiner = Examiner(start.statistics, healthy, start.colour_at(interval))

    @property
    def adoptions(self) -> int:
        """How often a new phi was adopted."""
        return int(self._compiled.observer.memory["phi_version"][0]) - self._first_version

    @property
    def late(self) -> int:
        """Outcomes that came too late and were left out."""
        return self._training.late

    def submit(self, learning: bool, fuel_temperature: float | None) -> None:
        """Hand over the events closed since the last call; learning: whether they are learned from."""
        while self._submitted < self._closed[0]:
            observer = self._compiled.observer
            window = event_window(observer, self._submitted)
            standstill = event_standstill(observer, self._submitted)
            theta = in_force(observer)
            self._training.submit(window if learning else None, standstill, theta, observer.constants)
            fuel = Fuel(fuel_temperature, observer.constants)
            innovations = event_innovations(observer, self._submitted)
            self._waiting.append(_Closed(fuel, window, innovations, theta))
            self._submitted += 1

    def judge(self) -> Judged:
        """Judge the event that the observer waits for: learned from, late or held, it is tested."""
        observer = self._compiled.observer
        memory = observer.memory[0]
        outcome = self._training.take()
        event = memory["events"][int(memory["events_taken"]) % PENDING_EVENTS].copy()
        closed = self._waiting.popleft()
        objections = self._examined(closed) if outcome is None else outcome.objections
        if outcome is not None:
            self._examiner.statistics = outcome.knowledge.statistics
            self._examiner.colour = outcome.knowledge.colour
        judge(observer, objections, outcome, is_coloured=self._examiner.colour is not None)
        if outcome is not None:
            self.rejected += outcome.adoption is not Adoption.ADOPTED
            self.known = replace(outcome.knowledge, phi_version=int(memory["phi_version"]))
        return Judged(event, objections, outcome, in_force(observer), observer.phi, closed.fuel)

    def _examined(self, closed: _Closed) -> tuple[Objection, ...]:
        return self._examiner.objections(
            closed.window, closed.innovations, closed.in_force, closed.fuel.constants
        )

    def injections(self, judged: Judged) -> Iterator[np.void]:
        """The injections, `stream.state.INJECTION`, to be reported with an event."""
        memory = self._compiled.observer.memory[0]
        while memory["injections_reported"] < memory["injections_begun"]:
            injection = memory["injections"][int(memory["injections_reported"]) % INJECTIONS]
            if injection["event"] > judged.event["number"]:
                break
            memory["injections_reported"] += 1
            yield injection
