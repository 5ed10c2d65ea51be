"""The injectors of a bench side by side: each is served in a thread of its own, and its failure is its own."""

import threading
from collections.abc import Callable, Sequence

from observer_rt.foundation.errors import CombinedError, ObserverError
from observer_rt.service.injector_service import InjectorService
from observer_rt.service.learning_queue import LearningQueue
from observer_rt.service.notify import Notifier, WatchdogPulse


def serve_side_by_side(
    services: Sequence[InjectorService],
    notifier: Notifier,
    stop: threading.Event,
    meanwhile: Callable[[threading.Event], None] | None = None,
) -> None:
    """Serve until `stop` is set or all have ended; `meanwhile`: is done in this thread until then.

    What failed is raised when all have ended: of a single injector as it is, of several as a `CombinedError`
    that names them, but for a mistake of this program.
    """
    together = _Together(services, notifier, stop)
    threads = [
        threading.Thread(target=together.serve, args=(number,), name=f"daemon {each.name}", daemon=True)
        for number, each in enumerate(services)
    ]
    for thread in threads:
        thread.start()
    try:
        if meanwhile is not None:
            meanwhile(stop)
    finally:
        for thread in threads:
            thread.join()
        together.close()
    together.raise_failures()


class _Together:
    """What the services share while they run."""

    def __init__(
        self, services: Sequence[InjectorService], notifier: Notifier, stop: threading.Event
    ) -> None:
        self._services = services
        self._stop = stop
        self._pulse = WatchdogPulse(notifier, len(services))
        self._learning = LearningQueue()
        self._lock = threading.Lock()
        self._running = len(services)
        self._failures: list[tuple[InjectorService, BaseException]] = []

    def serve(self, number: int) -> None:
        """One of them, to its end."""
        service = self._services[number]
        failure: BaseException | None = None
        try:
            with self._pulse.beating(number) as on_alive:
                service.run(self._stop, self._learning.share(), on_alive)
        except BaseException as error:
            failure = error
        with self._lock:
            self._running -= 1
            if failure is not None:
                self._failures.append((service, failure))
                if self._running and not self._stop.is_set():
                    service.tell_end(failure)
            if not self._running:
                self._stop.set()

    def close(self) -> None:
        self._learning.close()

    def raise_failures(self) -> None:
        failures: dict[str, ObserverError] = {}
        for service, failure in self._failures:
            if len(self._services) == 1 or not isinstance(failure, ObserverError):
                raise failure
            failures[service.name] = failure
        if failures:
            raise CombinedError(failures)
