"""Faults of the process: learning that hangs or fails, and a kill."""

from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

from tools.benchmarks.faults.scenario import Group, Kind

_LATE = frozenset(
    {"NOT_JUDGED", "NOT_LEARNED", "MODEL_INADEQUATE", "CONTRADICTED", "REVISED", "TOO_FEW_EVENTS"}
)
HUNG = Kind("learner_hung", Group.PROCESS, _LATE)
FAILING = Kind("learner_failing", Group.PROCESS, _LATE)
KILLED = Kind(
    "killed_and_restarted", Group.PROCESS, frozenset({"STARTING", "TOO_FEW_EVENTS", "SAMPLES_LOST"})
)
KINDS = (HUNG, FAILING, KILLED)


class UnreliableExecutor(Executor):
    """Learns at once, or not until it is well again, or fails."""

    def __init__(self) -> None:
        self.kind: Kind | None = None
        """What it does wrong now."""
        self._waiting: list[tuple[Future[Any], Callable[[], Any]]] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Call `fn`, now or later."""
        future: Future[Any] = Future()
        self._waiting.append((future, lambda: fn(*args, **kwargs)))
        self.work()
        return future

    def work(self) -> None:
        """Do what waits, unless it hangs."""
        while self._waiting and self.kind is not HUNG:
            future, job = self._waiting.pop(0)
            if self.kind is FAILING:
                future.set_exception(MemoryError("no memory to learn in"))
            else:
                future.set_result(job())
