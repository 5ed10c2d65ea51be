"""`observer-rt run`: daemons side by side with their files, links, log and view.

Each injector is served in a thread of its own, and its failure is its own.
"""

import gc
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from threading import Event

from rich.console import Console

from observer_rt.bus.links.opening import SharedBus
from observer_rt.bus.mapping.bus_map import BusMap, map_bench
from observer_rt.config.bench import Bench
from observer_rt.config.bench_file import NAME_PLACE
from observer_rt.daemon.daemon import Daemon
from observer_rt.daemon.event_logger import Deduplicator, EventLogger
from observer_rt.daemon.evidence import EvidenceKeeper, evidence_keeper
from observer_rt.daemon.link_opening import LinkOpening, StoppedError, buses_of, shared_buses
from observer_rt.daemon.log import ServiceLog, Voice
from observer_rt.daemon.notify import Notifier
from observer_rt.daemon.options import RunOptions
from observer_rt.daemon.persistence.keeper import Keeper, keeper_of, kept_files
from observer_rt.daemon.persistence.state_file import knowledge_beside, model_hash, restored_knowledge
from observer_rt.daemon.reloading import Reloading
from observer_rt.daemon.rights import (
    REMEDY,
    Processors,
    hurry,
    leave_to_loops,
    lock_memory,
    processors,
    rights,
)
from observer_rt.daemon.side_by_side import serve_side_by_side
from observer_rt.daemon.view import Overview, View, draw
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.reports.news import News
from observer_rt.engine.service.constants import bench_constants
from observer_rt.engine.service.learners import doubt_about_fit
from observer_rt.engine.words import Topic
from observer_rt.foundation.console import StopRequest, stop_on_signals
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.file_kinds import SERVICE_LOG
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.outputs import check_own_file
from observer_rt.foundation.units import MICROSECOND


@dataclass(frozen=True)
class Shared:
    """Means that all injectors share. buses: by number, those that can be opened once only; once: reports so far."""

    notifier: Notifier
    buses: Mapping[int, SharedBus]
    has_view: bool
    once: Deduplicator = field(default_factory=Deduplicator)


class InjectorService:
    """Waits for the injector's interfaces, then observes it, until asked to stop."""

    def __init__(
        self,
        bench: Bench,
        bus: BusMap,
        keeper: Keeper,
        voice: Voice,
        shared: Shared,
        evidence: EvidenceKeeper | None = None,
        learned: Knowledge | None = None,
        on_thread: Callable[[], object] = lambda: None,
    ) -> None:
        """bench: with this injector only; shared: with the others; on_thread: see `Daemon`.

        learned: before the bench file was changed, else from the file of the state, else from that beside the
        injector file. Logs what that is, and what it will observe.
        """
        injector = bench.injector
        self._bench = bench
        self._bus = bus
        self._keeper = keeper
        self._voice = voice
        self._shared = shared
        self._on_thread = on_thread
        self.model = model_hash(injector.parameters)
        """Model that it observes with."""
        self._daemon: Daemon | None = None  # before it runs
        asked = (self.model, injector.parameters.scaling.pressure, partial(voice.say, Topic.KEPT))
        self._knowledge = (
            learned
            or restored_knowledge(keeper.state, *asked)
            or knowledge_beside(injector.parameters_path, *asked)
        )
        if learned is not None:
            voice.say(Topic.KEPT, f"what was learned from {learned.state.events} events goes on in force")
        self._announce()
        self._evidence = evidence
        self.screen = View(voice.named(f"observer_rt: {self._buses}"), injector) if shared.has_view else None
        self._teller = EventLogger(
            voice, shared.notifier, bench_constants(injector).coefficients, shared.once
        )

    @property
    def name(self) -> str:
        """Name of the injector, empty where the bench has one."""
        return self._bench.injector.name

    @property
    def learned(self) -> Knowledge | None:
        """What was learned for its model."""
        return self._daemon.core.knowledge if self._daemon else self._knowledge

    @property
    def is_between_events(self) -> bool:
        """Whether no injection is under way, or waits to be judged."""
        return self._daemon is None or self._daemon.core.is_between_events

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
                [self._tell, *self._keeper.listeners, *([self._evidence.hear] if self._evidence else [])],
                on_alive,
                lambda: self._keeper.failures + self._voice.log.lost,
                learning,
                self._on_thread,
                lambda: self._evidence.kept if self._evidence else 0,
            )
            if self.screen is not None:
                self.screen.watch(daemon)
            self._daemon = daemon
            self._voice.say(Topic.START, "ready")
            stack.callback(self._farewell, daemon)  # whatever fails: the link, or the last write
            if self._evidence is not None:
                self._evidence.watch(daemon.core)
                stack.enter_context(self._evidence.keeping())
            with self._keeper.keeping(lambda: daemon.core.knowledge):
                daemon.run(stop)

    def tell_end(self, failure: BaseException) -> None:
        """Reports that this injector is not served any more, while others are."""
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
        inputs, outputs = (
            ", ".join(f"{bus.name_of(layout)} 0x{layout.frame_id:X}" for layout in layouts)
            for layouts in (bus.received, bus.sent)
        )
        rate = injector.config.sampling.rate_hz
        lookahead = constants.timing.lookahead
        say(
            Topic.START,
            f"{self._buses}: {inputs} at {rate:g} Hz -> {outputs}\n"
            f"{constants.substeps} integration steps a sample, look-ahead {lookahead} samples "
            f"({lookahead / rate / MICROSECOND:g} us)",
        )
        if added := injector.parameters.in_force:
            say(Topic.START, f"the model has {'; '.join(added)}")
        if doubt := doubt_about_fit(injector):
            say(Topic.START, f"warning: {doubt.text}; remedy: {doubt.remedy}")

    def _farewell(self, daemon: Daemon) -> None:
        say, core = self._voice.say, daemon.core
        for timing in core.timing:
            say(Topic.STOP, timing.as_text())
        if core.optional.energizing is not None:
            say(Topic.STOP, f"energizing: {core.optional.energizing.as_text()}")
        if daemon.latency is not None:
            say(Topic.STOP, f"latency: {daemon.latency.as_text()}")
        if self._evidence is not None:
            lost = f", {self._evidence.lost} lost" if self._evidence.lost else ""
            say(Topic.STOP, f"evidence: {self._evidence.kept} events kept{lost}")
        counters = core.counters
        spoilt = {
            "frames with a wrong CRC": counters.crc_errors,
            "of wrong length": counters.length_errors,
            "twice": counters.repeated_frames,
            "out of sequence": counters.sequence_errors,
            "log lines lost": self._voice.log.lost,
        }
        more = "".join(f", {count} {what}" for what, count in spoilt.items() if count)
        say(
            Topic.STOP,
            f"stopped after {counters.samples} samples, {counters.injections} injections; {counters.lost_samples} "
            f"samples lost, {daemon.dropped} frames dropped, {daemon.unsent} results unsent, "
            f"{daemon.arrivals.foreign_frames} frames of other senders, {counters.adoptions} corrections adopted, "
            f"{counters.late_adoptions} late, {counters.passed_over} events not learned from in time{more}",
        )


def refuse_shared(bench: Bench, options: RunOptions) -> None:
    """Raise `UserError` where several injectors would have one file of the command line, or one file two uses."""
    names = [injector.name for injector in bench.injectors]
    for option, key, path in (("--state", "file", options.state), ("--journal", "journal", options.journal)):
        if path is not None and len(names) > 1:
            raise UserError(
                f"{option} {path}",
                f"is one file for {len(names)} injectors: {', '.join(names)}",
                f'leave it out, and state [state] {key} = "{path.stem}_{NAME_PLACE}{path.suffix}" in the bench file',
            )
    if options.log is not None:
        kept = {path for each in bench.injectors for path in kept_files(each, options.state, options.journal)}
        if options.log.resolve() in {path.resolve() for path in kept if path}:
            raise UserError(
                f"--log {options.log}", "is the learned state or the journal", "name another file"
            )


@dataclass
class Serving:
    """Things that outlast a change of the bench file. screen: of the view, if there is one.

    learned: by name of the injector and model, so that nothing is lost where no file keeps it, and what was learned
    with a model is there again where taking over another one is undone.
    """

    screen: Console | None
    options: RunOptions
    log: ServiceLog
    stop: StopRequest
    own: Processors
    priority: int
    reloading: Reloading
    notifier: Notifier = field(default_factory=Notifier)
    learned: dict[tuple[str, str], Knowledge | None] = field(default_factory=dict)
    is_ready: bool = False

    def serve(self, bench: Bench) -> Bench | None:
        """Serve a bench until asked to stop, or another is to take its place, which is returned."""
        maps = map_bench(bench).injectors
        with ExitStack() as stack:
            services = self._services(bench, maps, stack)
            self.reloading.listen(bench, self.options.state)
            if not self.is_ready:
                self._get_ready()
            if self.stop.is_set():
                self.log.say(Topic.STOP, "stopped while it was starting")
                return None
            views = [service.screen for service in services if service.screen is not None]
            view = views[0] if len(views) == 1 else Overview(views)
            drawing = partial(draw, view, console=self.screen) if self.screen else None
            with self.reloading.watching(bench, services) as (ended, successor):
                serve_side_by_side(services, self.notifier, ended, drawing)
        self.learned |= {(service.name, service.model): service.learned for service in services}
        return None if self.stop.is_set() else successor()

    def say(self, text: str) -> None:
        """Logs a line about the start."""
        self.log.say(Topic.START, text)

    def _services(self, bench: Bench, maps: Sequence[BusMap], stack: ExitStack) -> list[InjectorService]:
        shared = Shared(self.notifier, shared_buses(bench, maps), self.screen is not None)
        services = []
        for number, (alone, bus) in enumerate(zip(bench.each, maps, strict=True)):
            voice = Voice(self.log, alone.injector.name)
            files = keeper_of(alone, self.options.state, self.options.journal, partial(voice.say, Topic.KEPT))
            keeper = stack.enter_context(files)
            evidence = stack.enter_context(evidence_keeper(alone.injector, partial(voice.say, Topic.KEPT)))
            known = self.learned.get((alone.injector.name, model_hash(alone.injector.parameters)))
            claim = partial(hurry, self.own.of(number), self.priority)
            services.append(InjectorService(alone, bus, keeper, voice, shared, evidence, known, claim))
        if any(link.config.interface == "virtual" for link in bench.config.buses):
            self.say(
                "the virtual bus ends at this process: nothing will come in (vcan0 reaches other programs)"
            )
        return services

    def _get_ready(self) -> None:
        """Claim what the machine grants."""
        if self.stop.is_set():
            return
        self.notifier.ready()
        granted = lock_memory(rights(self.priority))
        leave_to_loops(self.own)
        self.say(f"{granted.as_text()}, {self.own.as_text()}")
        if self.own.trouble:
            self.say(f"warning: {self.own.trouble}\n  remedy: {REMEDY}")
        gc.collect()
        gc.freeze()  # a full collection would stop every Python loop for tens of milliseconds
        self.is_ready = True


def serve(bench: Bench, options: RunOptions, console: Console, read_again: Callable[[], Bench]) -> None:
    """Run the daemons of all injectors until SIGINT or SIGTERM, with files instead of those the bench file names.

    read_again: the bench as its file is now, for a reload; raises `UserError` for one that may not start.
    Raises `UserError` for files that do not fit, `RunError` when links fail.
    """
    with ExitStack() as stack:
        has_view = options.view and console.is_terminal
        log = stack.enter_context(_log(options, console, has_view))
        if options.view and not has_view:
            log.say(Topic.START, "no terminal for the view: one line an injection instead")
        # from here on, so that a signal while starting is not lost
        stop = stack.enter_context(stop_on_signals(reloads=True))
        stack.callback(gc.unfreeze)
        own = processors(bench.config.realtime.cpus, len(bench.injectors))
        priority = bench.config.realtime.priority
        reloading = Reloading(stop, read_again, partial(log.say, Topic.START), stack)
        serving = Serving(console if has_view else None, options, log, stop, own, priority, reloading)
        before: Bench | None = None
        now: Bench | None = bench
        while now is not None:
            try:
                before, now = now, serving.serve(now)
            except UserError as error:
                if before is None:
                    raise
                serving.say(f"warning: {bench.path} cannot be served, the one before goes on: {error}")
                reloading.refuse(error)
                before, now = None, before


def _log(options: RunOptions, console: Console, has_view: bool) -> ServiceLog:
    """The log of the options. Raises `UserError` for a file that cannot be written."""
    if options.log is not None:
        check_own_file("--log", options.log, SERVICE_LOG)
        with file_errors(options.log):
            options.log.touch()
    return ServiceLog(console, options.log, sys.stdout if options.json else None, quiet=has_view)
