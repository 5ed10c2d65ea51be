"""Daemons side by side: each in a thread of its own, all learning in one, whose turns are theirs in turn."""

from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from threading import Event, Lock, Thread
from typing import TYPE_CHECKING, Any

from observer_rt.daemon.notify import Notifier, WatchdogPulse
from observer_rt.daemon.rights import take_time
from observer_rt.foundation.errors import CombinedError, ObserverError

if TYPE_CHECKING:
    from observer_rt.daemon.run import InjectorService

_TURN = 0.2  # s between two looks at what signals ask for


class LearningQueue:
    """However many events one injector has waiting, the others' next ones come before its second."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="learning", initializer=take_time)
        self._lock = Lock()
        self._in_turn: deque[Share] = deque()

    def share(self) -> "Share":
        """The executor of one injector; its jobs are done in their order."""
        share = Share(lambda: self._thread.submit(self._do_next))
        with self._lock:
            self._in_turn.append(share)
        return share

    def close(self) -> None:
        """Wait for the job that is being done; what waits is left."""
        self._thread.shutdown(cancel_futures=True)

    def _do_next(self) -> None:
        """One job of whoever's turn it is, if any has one."""
        with self._lock:
            turn = next((n for n, share in enumerate(self._in_turn) if share.waiting), None)
            if turn is None:
                return
            self._in_turn.rotate(-1 - turn)
            future, job = self._in_turn[-1].waiting.popleft()
        if future.set_running_or_notify_cancel():
            try:
                future.set_result(job())
            except BaseException as error:
                future.set_exception(error)


class Share(Executor):
    """Share of one injector in the queue."""

    def __init__(self, do_soon: Callable[[], object]) -> None:
        self.waiting: deque[tuple[Future[Any], Callable[[], Any]]] = deque()
        self._do_soon = do_soon

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Have `fn` called in its turn."""
        future: Future[Any] = Future()
        self.waiting.append((future, lambda: fn(*args, **kwargs)))
        self._do_soon()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leave what waits, if so asked; the queue goes on for the others."""
        while cancel_futures and self.waiting:
            future, _ = self.waiting.popleft()
            future.cancel()


def serve_side_by_side(
    services: Sequence["InjectorService"],
    notifier: Notifier,
    stop: Event,
    meanwhile: Callable[[Event], None] | None,
) -> None:
    """Serve until `stop` is set or all have ended; `meanwhile`: is done in this thread until then.

    What failed is raised when all have ended: of a single injector as it is, of several as a `CombinedError`
    that names them, but for a mistake of this program.
    """
    pulse, learning, lock = WatchdogPulse(notifier, len(services)), LearningQueue(), Lock()
    running = set(range(len(services)))
    failures: dict[int, BaseException] = {}  # in the order in which they came

    def serve_one(number: int) -> None:
        service = services[number]
        try:
            with pulse.beating(number) as on_alive:
                service.run(stop, learning.share(), on_alive)
        except BaseException as error:
            failures[number] = error
        with lock:
            running.remove(number)
            if number in failures and running and not stop.is_set():
                service.tell_end(failures[number])
            if not running:
                stop.set()

    threads = [
        Thread(target=serve_one, args=(number,), name=f"daemon {each.name}", daemon=True)
        for number, each in enumerate(services)
    ]
    for thread in threads:
        thread.start()
    try:
        if meanwhile is not None:
            meanwhile(stop)
    finally:
        for thread in threads:
            while thread.is_alive():  # a signal that another thread took wakes no join without an end
                thread.join(_TURN)
        learning.close()
    by_name: dict[str, ObserverError] = {}
    for number, failure in failures.items():
        if len(services) == 1 or not isinstance(failure, ObserverError):
            raise failure
        by_name[services[number].name] = failure
    if by_name:
        raise CombinedError(by_name)
