"""What several injectors of one process share, and cannot; one queue of events to learn from, for all."""

import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from observer_rt.bus.links.opening import SharedBus
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench import Bench
from observer_rt.config.bench_file import NAME_PLACE
from observer_rt.foundation.errors import UserError
from observer_rt.service.notify import Notifier
from observer_rt.service.opening import buses_of, connected, wanted_on
from observer_rt.service.reports.news import Once
from observer_rt.service.rights import take_time

OPENED_OFTEN = ("socketcan", "virtual")  # interfaces whose channels can be opened several times


@dataclass(frozen=True)
class Shared:
    """What all injectors use. buses: by their number, those that can be opened once only; once: what was said."""

    notifier: Notifier
    buses: Mapping[int, SharedBus]
    once: Once = field(default_factory=Once)


def shared_buses(bench: Bench, maps: Iterable[BusMap]) -> dict[int, SharedBus]:
    """The buses, by their numbers, that several injectors use and that can be opened once only."""
    shared = {}
    for number, named in enumerate(bench.config.buses):
        users = [bus for bus in maps if number in buses_of(bus)]
        if len(users) > 1 and named.config.interface not in OPENED_OFTEN:
            wanted = list(dict.fromkeys(each for bus in users for each in wanted_on(bus, number)))
            computer_time = any(len(buses_of(bus)) > 1 for bus in users)
            shared[number] = SharedBus(partial(connected, named, wanted, computer_time))
    return shared


def refuse_shared(bench: Bench, state: Path | None, journal: Path | None) -> None:
    """Raise `UserError` where several injectors would have one file of the command line."""
    names = [injector.name for injector in bench.injectors]
    for option, key, path in (("--state", "file", state), ("--journal", "journal", journal)):
        if path is not None and len(names) > 1:
            raise UserError(
                f"{option} {path}",
                f"is one file for {len(names)} injectors: {', '.join(names)}",
                f'leave it out, and state [state] {key} = "{path.stem}_{NAME_PLACE}{path.suffix}" in the bench file',
            )


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

    def __init__(self, do_soon: Callable[[], object]) -> None:
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
