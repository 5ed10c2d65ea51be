"""`observer-rt run`: daemons side by side with their signals, log, learned state and view.

Each injector is served in a thread of its own, and its failure is its own.
"""

import gc
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Event

from rich.console import Console

from observer_rt.bus.mapping.bus_map import BenchMap, map_bench
from observer_rt.config.bench import Bench
from observer_rt.foundation.compilation import compiled_code
from observer_rt.foundation.errors import CombinedError, ObserverError
from observer_rt.foundation.files import file_errors
from observer_rt.service.injector_service import InjectorService
from observer_rt.service.keeping.keeper import keeper_of
from observer_rt.service.log import ServiceLog, Voice
from observer_rt.service.notify import Notifier, WatchdogPulse
from observer_rt.service.rights import REMEDY, Processors, leave_to_loops, lock_memory, processors, rights
from observer_rt.service.screen.view import Overview, Screen, draw
from observer_rt.service.sharing import LearningQueue, Shared, refuse_shared, shared_buses
from observer_rt.service.warm_up import warm_up
from observer_rt.service.words import Topic
from observer_rt.terminal.compiling import tell_compiling
from observer_rt.terminal.console import check_destination, stop_on_signals


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


@dataclass(frozen=True)
class RunOptions:
    """Options of the command: state, log, journal: files; records: injections as JSON lines on stdout."""

    state: Path | None = None
    view: bool = False
    records: bool = False
    log: Path | None = None
    journal: Path | None = None


def serve(bench: Bench, options: RunOptions, console: Console) -> None:
    """Run the daemons of all injectors until SIGINT or SIGTERM.

    state, journal: files to keep, instead of those the bench file names.
    Raises `UserError` for files that do not fit, `RunError` when links fail.
    """
    mapped = map_bench(bench)
    refuse_shared(bench, options.state, options.journal)
    has_view = options.view and console.is_terminal
    notifier = Notifier()
    with ExitStack() as stack:
        log = stack.enter_context(_log(options, console, has_view))
        if options.view and not has_view:
            log.say(Topic.START, "no terminal for the view: one line an injection instead")
        own = processors(bench.config.realtime.cpus, len(bench.injectors))
        services = _services(bench, mapped, options, log, notifier, own, stack)
        if any(link.config.interface == "virtual" for link in bench.config.buses):
            log.say(
                Topic.START,
                "the virtual bus ends at this process: nothing will come in (vcan0 reaches other programs)",
            )
        # from here on, so that a signal while compiling is neither lost nor an interrupt in the middle of it
        stop = stack.enter_context(stop_on_signals())
        tell_compiling(partial(log.say, Topic.START))
        if trouble := compiled_code().trouble:
            log.say(Topic.START, f"warning: {trouble}\n  remedy: {compiled_code().remedy}")
        for alone, bus in zip(bench.each, mapped.injectors, strict=True):
            warm_up(alone, bus, stop)
        notifier.ready()
        granted = lock_memory(rights())
        leave_to_loops(own)
        log.say(Topic.START, f"{granted.as_text()}, {own.as_text()}")
        if own.trouble:
            log.say(Topic.START, f"warning: {own.trouble}\n  remedy: {REMEDY}")
        stack.callback(gc.unfreeze)
        gc.collect()
        gc.freeze()  # a full collection would stop every Python loop for tens of milliseconds
        serve_side_by_side(services, notifier, stop, _drawing(services, console) if has_view else None)


def _services(
    bench: Bench,
    mapped: BenchMap,
    options: RunOptions,
    log: ServiceLog,
    notifier: Notifier,
    own: Processors,
    stack: ExitStack,
) -> list[InjectorService]:
    """One for each injector; the stack lets go of their files."""
    services = []
    shared = Shared(notifier, shared_buses(bench, mapped.injectors))
    for number, (alone, bus) in enumerate(zip(bench.each, mapped.injectors, strict=True)):
        voice = Voice(log, alone.injector.name)
        tell_kept = partial(voice.say, Topic.KEPT)
        keeper = stack.enter_context(keeper_of(alone, options.state, options.journal, tell_kept))
        services.append(InjectorService(alone, bus, keeper, voice, shared, own.of(number)))
    return services


def _drawing(services: list[InjectorService], console: Console) -> Callable[[Event], None]:
    screens = [service.screen for service in services]
    screen: Screen = screens[0] if len(screens) == 1 else Overview(screens)
    return lambda stop: draw(screen, stop, console)


def _log(options: RunOptions, console: Console, has_view: bool) -> ServiceLog:
    """The log of the options. Raises `UserError` for a file that cannot be written."""
    if options.log is not None:
        check_destination("--log", options.log)
        with file_errors(options.log):
            options.log.touch()
    return ServiceLog(console, options.log, sys.stdout if options.records else None, quiet=has_view)
