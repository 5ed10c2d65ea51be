"""`observer-rt run`: daemons side by side with their files, links, log and view.

Each injector is served in a thread of its own, and its failure is its own.
"""

import gc
import sys
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from threading import Event, Lock, Thread
from typing import Any

from rich.console import Console

from observer_rt.bus.links.opening import SharedBus
from observer_rt.bus.mapping.bus_map import BusMap, map_bench
from observer_rt.config.bench import Bench
from observer_rt.config.bench_file import NAME_PLACE
from observer_rt.foundation.compilation import compiled_code
from observer_rt.foundation.errors import CombinedError, ObserverError, UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.units import MICROSECOND
from observer_rt.service.compiled.constants import bench_constants
from observer_rt.service.core.learners import doubt_about_fit
from observer_rt.service.daemon import Daemon
from observer_rt.service.keeping.keeper import Keeper, keeper_of
from observer_rt.service.keeping.state_file import model_hash, restored_knowledge
from observer_rt.service.log import ServiceLog, Voice
from observer_rt.service.notify import Notifier, WatchdogPulse
from observer_rt.service.opening import LinkOpening, StoppedError, buses_of, shared_buses
from observer_rt.service.reports.news import News, Once, Teller
from observer_rt.service.rights import REMEDY, leave_to_loops, lock_memory, processors, rights, take_time
from observer_rt.service.screen.view import Overview, View, draw
from observer_rt.service.warm_up import warm_up
from observer_rt.service.words import Topic
from observer_rt.terminal.compiling import tell_compiling
from observer_rt.terminal.console import check_destination, stop_on_signals


@dataclass(frozen=True)
class Shared:
    """What all injectors use. buses: by their number, those that can be opened once only; once: what was said."""

    notifier: Notifier
    buses: Mapping[int, SharedBus]
    has_view: bool
    once: Once = field(default_factory=Once)


class InjectorService:
    """Waits for the injector's interfaces, then observes it, until told to stop."""

    def __init__(
        self,
        bench: Bench,
        bus: BusMap,
        keeper: Keeper,
        voice: Voice,
        shared: Shared,
        processor: int | None = None,
    ) -> None:
        """bench: with this injector only; shared: with the others; processor: of its loop.

        Says what was learned before, and what it will observe.
        """
        injector = bench.injector
        self._bench = bench
        self._bus = bus
        self._keeper = keeper
        self._voice = voice
        self._shared = shared
        self._processor = processor
        self._knowledge = restored_knowledge(
            keeper.state,
            model_hash(injector.parameters),
            injector.parameters.scaling.pressure,
            partial(voice.say, Topic.KEPT),
        )
        self._announce()
        self.screen = View(voice.named(f"observer_rt: {self._buses}"), injector) if shared.has_view else None
        self._teller = Teller(voice, shared.notifier, bench_constants(injector).coefficients, shared.once)

    @property
    def name(self) -> str:
        """Of the injector, empty where the bench has one."""
        return self._bench.injector.name

    def run(self, stop: Event, learning: Executor, on_alive: Callable[[], None]) -> None:
        """Serve until `stop` is set; learning, on_alive: as of `Daemon`.

        Raises `UserError` or `RunError` for a link that fails, and for files that cannot be written at the end.
        """
        with ExitStack() as stack:
            opening = LinkOpening(self._bench, self._bus, self._shared.buses, self._tell, stop, on_alive)
            try:
                opening.tell_other_senders()
                links = [stack.enter_context(link) for link in opening.links()]
            except StoppedError:
                self._voice.say(Topic.STOP, "stopped while it waited for the interface")
                return
            daemon = Daemon(
                self._bench,
                self._bus,
                links,
                self._knowledge,
                [self._tell, *self._keeper.listeners],
                on_alive,
                lambda: self._keeper.failures + self._voice.log.lost,
                learning,
                self._processor,
            )
            if self.screen is not None:
                self.screen.watch(daemon)
            self._voice.say(Topic.START, "ready")
            with self._keeper.keeping(lambda: daemon.core.knowledge):
                daemon.run(stop)
            self._farewell(daemon)

    def tell_end(self, failure: BaseException) -> None:
        """Say that this injector is not served any more, while others are."""
        self._voice.say(Topic.STOP, f"warning: ended, the other injectors go on: {failure}")

    def _tell(self, news: News) -> None:
        if self.screen is not None:
            self.screen.hear(news)
        self._teller.hear(news)

    @property
    def _buses(self) -> str:
        """Interfaces and channels of its buses."""
        links = self._bench.config.buses
        return ", ".join(f"{links[n].config.interface} {links[n].label}" for n in sorted(buses_of(self._bus)))

    def _announce(self) -> None:
        injector, bus, say = self._bench.injector, self._bus, self._voice.say
        constants = bench_constants(injector)
        inputs = ", ".join(map(bus.name_of, bus.received))
        outputs = ", ".join(map(bus.name_of, bus.sent))
        rate = injector.config.sampling.rate_hz
        lookahead = constants.timing.lookahead
        say(
            Topic.START,
            f"{self._buses}: {inputs} at {rate:g} Hz -> {outputs}\n"
            f"{constants.substeps} integration steps a sample, look-ahead {lookahead} samples "
            f"({lookahead / rate / MICROSECOND:g} us)",
        )
        if doubt := doubt_about_fit(injector):
            say(Topic.START, f"warning: {doubt.text}; remedy: {doubt.remedy}")

    def _farewell(self, daemon: Daemon) -> None:
        say, core = self._voice.say, daemon.core
        for timing in core.timing:
            say(Topic.STOP, timing.as_text())
        if core.optional.energizing is not None:
            say(Topic.STOP, f"energizing: {core.optional.energizing.as_text()}")
        counters = core.counters
        lost = f", {self._voice.log.lost} log lines lost" if self._voice.log.lost else ""
        say(
            Topic.STOP,
            f"stopped after {counters.samples} samples, {counters.injections} injections; {counters.lost_samples} "
            f"samples lost, {daemon.dropped} frames dropped, {daemon.unsent} results unsent, "
            f"{daemon.arrivals.foreign_frames} frames of other senders, {counters.adoptions} phi adopted, "
            f"{counters.late_adoptions} late, {counters.passed_over} events not learned from in time{lost}",
        )


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
    """What one injector has in the queue."""

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
    services: Sequence[InjectorService],
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
            thread.join()
        learning.close()
    by_name: dict[str, ObserverError] = {}
    for number, failure in failures.items():
        if len(services) == 1 or not isinstance(failure, ObserverError):
            raise failure
        by_name[services[number].name] = failure
    if by_name:
        raise CombinedError(by_name)


@dataclass(frozen=True)
class RunOptions:
    """Options of the command: state, log, journal: files; records: injections as JSON lines on stdout."""

    state: Path | None = None
    view: bool = False
    records: bool = False
    log: Path | None = None
    journal: Path | None = None


def refuse_shared(bench: Bench, options: RunOptions) -> None:
    """Raise `UserError` where several injectors would have one file of the command line."""
    names = [injector.name for injector in bench.injectors]
    for option, key, path in (("--state", "file", options.state), ("--journal", "journal", options.journal)):
        if path is not None and len(names) > 1:
            raise UserError(
                f"{option} {path}",
                f"is one file for {len(names)} injectors: {', '.join(names)}",
                f'leave it out, and state [state] {key} = "{path.stem}_{NAME_PLACE}{path.suffix}" in the bench file',
            )


def serve(bench: Bench, options: RunOptions, console: Console) -> None:
    """Run the daemons of all injectors until SIGINT or SIGTERM, with files instead of those the bench file names.

    Raises `UserError` for files that do not fit, `RunError` when links fail.
    """
    mapped = map_bench(bench)
    has_view = options.view and console.is_terminal
    notifier = Notifier()
    with ExitStack() as stack:
        log = stack.enter_context(_log(options, console, has_view))
        if options.view and not has_view:
            log.say(Topic.START, "no terminal for the view: one line an injection instead")
        own = processors(bench.config.realtime.cpus, len(bench.injectors))
        shared = Shared(notifier, shared_buses(bench, mapped.injectors), has_view)
        services = []
        for number, (alone, bus) in enumerate(zip(bench.each, mapped.injectors, strict=True)):
            voice = Voice(log, alone.injector.name)
            files = keeper_of(alone, options.state, options.journal, partial(voice.say, Topic.KEPT))
            keeper = stack.enter_context(files)
            services.append(InjectorService(alone, bus, keeper, voice, shared, own.of(number)))
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
        views = [service.screen for service in services if service.screen is not None]
        drawn = views[0] if len(views) == 1 else Overview(views)
        serve_side_by_side(services, notifier, stop, partial(draw, drawn, console=console) if views else None)


def _log(options: RunOptions, console: Console, has_view: bool) -> ServiceLog:
    """The log of the options. Raises `UserError` for a file that cannot be written."""
    if options.log is not None:
        check_destination("--log", options.log)
        with file_errors(options.log):
            options.log.touch()
    return ServiceLog(console, options.log, sys.stdout if options.records else None, quiet=has_view)
