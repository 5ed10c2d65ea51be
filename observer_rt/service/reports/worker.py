"""Learning beside the loop: events in, outcomes back in the same order."""

from collections import deque
from concurrent.futures import Executor, Future
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.predictor import Window
from observer_rt.observer.learning.knowledge import EventLearner, Outcome
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.observer.stream.state import Constants


class InlineExecutor(Executor):
    """Runs what is submitted at once, in the caller's thread."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Call `fn` and return its finished future."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class Training:
    """Queue between the observer and its learner; the executor must run one job at a time, in order."""

    def __init__(self, learner: EventLearner, executor: Executor, lockstep: bool) -> None:
        """lockstep: `take` waits for an outcome that is not ready; otherwise it is late and skipped."""
        self._learner = learner
        self._executor = executor
        self._lockstep = lockstep
        self._pending: deque[Future[Outcome] | None] = deque()
        self.late = 0

    def submit(
        self,
        window: Window | None,
        standstill: Standstill,
        in_force: NDArray[np.float64],
        constants: Constants,
    ) -> None:
        """Queue an event with the constants during it; `window` None: there is nothing to learn from it."""
        if window is None:
            self._pending.append(None)
        else:
            learned = self._executor.submit(self._learner.learn, window, standstill, in_force, constants)
            self._pending.append(learned)

    def take(self) -> Outcome | None:
        """Outcome of the oldest event; None when there was nothing to learn or the outcome is late."""
        future = self._pending.popleft()
        if future is None:
            return None
        if not self._lockstep and not future.done():
            self.late += 1
            return None
        return future.result()
