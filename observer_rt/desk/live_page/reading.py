"""The daemons of a bench, each read at its control socket by a thread: their states, and their last injections."""

import threading
import time
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import takewhile
from socket import SHUT_RDWR, socket
from typing import Any

from observer_rt.config.bench import Bench
from observer_rt.daemon import snapshot
from observer_rt.daemon.control_socket import daemon_connection, socket_places
from observer_rt.foundation.errors import REMEDY, ObserverError
from observer_rt.foundation.units import NANOSECONDS

SILENT_AFTER = 1.0  # s without a look of the daemon at itself, after which nothing of it is of now
WAIT = 0.3  # s that a daemon waits for news before it answers
LAWS_EVERY = 1.0  # s: curves of what was learned are long, and nobody follows them injection by injection
_PAUSE = 0.02  # s between two questions, so that many injections a second make few
_AGAIN_AFTER = 0.3  # s, from one look for a daemon to the next


@dataclass(frozen=True)
class InjectorSnapshot:
    """An injector now: its name, state in words, faults, laws learned; silent: its daemon does not answer."""

    name: str
    state: str
    words: str
    level: snapshot.StatusLevel
    faults: tuple[snapshot.Fault, ...] = ()
    silent: bool = False
    lost: int = 0
    learned: tuple[Mapping[str, Any], ...] = ()


class DaemonReader:
    """Reads the daemon of one injector; any thread may ask for what was read."""

    def __init__(self, alone: Bench) -> None:
        injector = alone.injector
        self.name = injector.name
        self._places = socket_places(injector)
        which = f" --injector {self.name}" if self.name else ""
        self._start = f"start `observer-rt run --bench {alone.path}{which}`, or see its log"
        self._begin = time.time_ns()
        self._failure = ""
        self._daemon: socket | None = None
        self._status: snapshot.Status | None = None
        self._learned: tuple[Mapping[str, Any], ...] = ()
        self._run_read = self._last_read = 0  # run of the daemon, and injection of it, that were read last
        self._injections: deque[snapshot.ShownInjection] = deque(maxlen=snapshot.KEPT)
        self.count = 0
        """Injections so far, whichever daemon counted: `snapshot.ShownInjection.count` of the last one."""
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"reading {self.name}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._stop.set()
        if (daemon := self._daemon) is not None:
            with suppress(OSError):
                daemon.shutdown(SHUT_RDWR)
        self._thread.join(_AGAIN_AFTER)  # one that waits for a hung daemon ends with the process

    @property
    def buses(self) -> Mapping[str, snapshot.BusStatus]:
        """Buses of the daemon by their labels; empty while the daemon is silent."""
        status = self._status
        if status is None or self._is_old(status.moment):
            return {}
        return {bus.label: bus for bus in status.buses}

    def injections(self, since: int = 0) -> list[snapshot.ShownInjection]:
        """Injections kept after the `since`-th, the newest last."""
        return [*takewhile(lambda injection: injection.count > since, reversed(list(self._injections)))][::-1]

    def seen(self) -> InjectorSnapshot:
        """State and faults now."""
        status = self._status
        if status is not None and not self._is_old(status.moment):
            of_now = status.state, status.words, status.level, status.faults
            return InjectorSnapshot(self.name, *of_now, lost=status.lost, learned=self._learned)
        since = self._begin if status is None else status.moment
        if status is None and not self._is_old(since):
            return InjectorSnapshot(
                self.name, "no status yet", "nothing was heard of the observer", snapshot.StatusLevel.WAITING
            )
        what, _, remedy = self._failure.partition(REMEDY)
        silence = snapshot.Fault(what or "the observer does not answer", since, remedy or self._start)
        lost = 0 if status is None else status.lost
        of_old = "OBSERVER SILENT", "all below is old", snapshot.StatusLevel.BAD, (silence,)
        return InjectorSnapshot(self.name, *of_old, silent=True, lost=lost)

    @staticmethod
    def _is_old(moment: int) -> bool:
        return time.time_ns() - moment > SILENT_AFTER * NANOSECONDS

    def _run(self) -> None:
        while not self._stop.is_set():
            failures = []
            for file in self._places:
                try:
                    if (daemon := daemon_connection(file)) is not None:
                        self._follow(daemon)
                except ObserverError as error:
                    failures.append(str(error))
                except OSError:
                    pass  # it has ended
            self._failure = next(iter(failures), "")
            self._stop.wait(_AGAIN_AFTER)

    def _follow(self, daemon: socket) -> None:
        """Ask for news again and again. Raises `ObserverError` and OSError once there is no answer."""
        self._daemon, due = daemon, 0.0
        with daemon, daemon.makefile("rwb") as stream:
            while not self._stop.is_set():
                wants_laws = (now := time.monotonic()) >= due
                asked = {"run": self._run_read, "since": self._last_read, "wait": WAIT, "laws": wants_laws}
                stream.write(snapshot.line_of({"request": snapshot.SNAPSHOT, **asked}))
                stream.flush()
                answer = snapshot.read_snapshot(stream)
                if answer.status.run != self._run_read:
                    self._run_read, self._last_read = answer.status.run, 0
                for injection in answer.injections:
                    self._last_read = injection.count
                    self._injections.append(replace(injection, count=self.count + 1))
                    self.count += 1
                if wants_laws:
                    due, self._learned = now + LAWS_EVERY, answer.status.learned
                self._status = answer.status
                self._stop.wait(_PAUSE)


class Watching:
    """All daemons of a bench."""

    def __init__(self, bench: Bench) -> None:
        self.readers = [DaemonReader(alone) for alone in bench.per_injector]

    def close(self) -> None:
        """Read no longer."""
        for reader in self.readers:
            reader.close()

    def buses(self) -> list[snapshot.BusStatus]:
        """Every bus as it is now; a bus that injectors share stands once."""
        down: dict[str, str] = {}
        for reader in self.readers:
            for label, bus in reader.buses.items():
                down[label] = down.get(label) or bus.down
        return [snapshot.BusStatus(label, why) for label, why in down.items()]
