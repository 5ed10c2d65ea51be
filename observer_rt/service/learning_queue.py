"""One queue of what is to be learned, for all injectors: a thread beside the loops, an event of each in turn."""

import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from typing import Any, ParamSpec, TypeVar

from observer_rt.service.rights import take_time

_Result = TypeVar("_Result")
_Arguments = ParamSpec("_Arguments")


class LearningQueue:
    """However many events one injector has waiting, the others' next ones come before its second."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="learning", initializer=take_time)
        self._lock = threading.Lock()
        self._in_turn: deque[Share] = deque()

    def share(self) -> "Share":
        """The executor of one injector; its jobs are done in their order."""
        share = Share(self._do_soon)
        with self._lock:
            self._in_turn.append(share)
        return share

    def close(self) -> None:
        """Wait for the job that is being done; what waits is left."""
        self._thread.shutdown(cancel_futures=True)

    def _do_soon(self) -> None:
        self._thread.submit(self._do_next)

    def _do_next(self) -> None:
        """One job of whoever's turn it is, if any has one."""
        with self._lock:
            for _ in range(len(self._in_turn)):
                share = self._in_turn[0]
                self._in_turn.rotate(-1)
                if share.waiting:
                    future, job = share.waiting.popleft()
                    break
            else:
                return
        if future.set_running_or_notify_cancel():
            try:
                future.set_result(job())
            except BaseException as error:
                future.set_exception(error)


class Share(Executor):
    """What one injector has in the queue."""

    def __init__(self, do_soon: Callable[[], None]) -> None:
        self.waiting: deque[tuple[Future[Any], Callable[[], Any]]] = deque()
        self._do_soon = do_soon

    def submit(
        self, fn: Callable[_Arguments, _Result], /, *args: _Arguments.args, **kwargs: _Arguments.kwargs
    ) -> Future[_Result]:
        """Have `fn` called in its turn."""
        future: Future[_Result] = Future()
        self.waiting.append((future, lambda: fn(*args, **kwargs)))
        self._do_soon()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave what waits, if so asked; the queue goes on for the others."""
        while cancel_futures and self.waiting:
            future, _ = self.waiting.popleft()
            future.cancel()
