"""`observer-rt run`: the daemon of one injector with its files, links, log and view."""

import gc
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from threading import Event, Thread
from typing import TYPE_CHECKING

from rich.console import Console

from observer_rt.bus.mapping.bus_map import BusMap, map_bus
from observer_rt.config.bench import Bench
from observer_rt.daemon.bus_connection import LinkOpening, StoppedError, buses_of
from observer_rt.daemon.daemon import Daemon
from observer_rt.daemon.keeper import Keeper, UnsavedError, keeper_of, kept_files
from observer_rt.daemon.log import EventLogger, Notifier, ServiceLog
from observer_rt.daemon.reloading import Reloading
from observer_rt.daemon.rights import REMEDY, Processors, hurry, leave_to_loops, lock_memory, processors, rights
from observer_rt.daemon.snapshot_keeper import SnapshotKeeper
from observer_rt.daemon.state_file import knowledge_beside, model_hash, restored_knowledge
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.reports.news import News
from observer_rt.engine.service.injector import bench_constants, doubt_about_fit
from observer_rt.engine.words import Topic
from observer_rt.foundation.console import StopRequest, stop_on_signals
from observer_rt.foundation.errors import ObserverError, UserError, file_errors
from observer_rt.foundation.options import RunOptions
from observer_rt.foundation.outputs import SERVICE_LOG, check_own_file
from observer_rt.foundation.units import MICROSECOND

if TYPE_CHECKING:
    from observer_rt.daemon.evidence import EvidenceKeeper

_TURN = 0.2  # s between two looks at what signals ask for
UNSAVED = "the reload goes on; what was learned with the model before is kept by this process only, for the way back"


class InjectorService:
    """Waits for the injector's interfaces, then observes it, until asked to stop."""

    def __init__(
        self,
        bench: Bench,
        bus: BusMap,
        keeper: Keeper,
        log: ServiceLog,
        notifier: Notifier,
        screen: Console | None,
        evidence: "EvidenceKeeper | None" = None,
        learned: Knowledge | None = None,
        on_thread: Callable[[], object] = lambda: None,
    ) -> None:
        """bench: with one injector; screen: terminal of the view, None without one; on_thread: see `Daemon`.

        learned: before the bench file was changed, else from the file of the state, else from that beside the
        injector file. Logs what that is, and what it will observe.
        """
        injector = bench.injector
        self._bench = bench
        self._bus = bus
        self._keeper = keeper
        self._log = log
        self._notifier = notifier
        self._on_thread = on_thread
        self.model = model_hash(injector.parameters)
        """Model that it observes with."""
        self._daemon: Daemon | None = None  # before it runs
        asked = (injector.parameters, partial(log.say, Topic.KEPT))
        self._knowledge = (
            learned or restored_knowledge(keeper.state, *asked) or knowledge_beside(injector.parameters_path, *asked)
        )
        if learned is not None:
            log.say(Topic.KEPT, f"what was learned from {learned.state.events} events goes on in force")
        self._announce()
        self._evidence = evidence
        self.snapshots = SnapshotKeeper(bench)
        self.drawing: Callable[[Event], None] | None = None
        """Draws the view until the event is set; None without one."""
        if screen is not None:
            from observer_rt.daemon.view import View, draw  # optional: --view

            title = " ".join(filter(None, ("observer_rt", injector.name)))
            self.drawing = partial(draw, View(f"{title}: {self._buses}", self.snapshots.snapshot), console=screen)
        self._teller = EventLogger(log, notifier, bench_constants(injector).coefficients, injector.name)

    @property
    def learned(self) -> Knowledge | None:
        """What was learned for its model."""
        return self._daemon.core.knowledge if self._daemon else self._knowledge

    @property
    def is_observing(self) -> bool:
        """Whether it has got its links, and observes or did."""
        return self._daemon is not None

    @property
    def is_between_events(self) -> bool:
        """Whether no injection is under way, or waits to be judged."""
        return self._daemon is None or self._daemon.core.is_between_events

    @property
    def other_bench(self) -> Bench | None:
        """The bench as its lift sensor is, dead or alive again; None where it is as the bench says, or is needed."""
        daemon, was_dead = self._daemon, self._bench.injector.is_lift_dead
        if daemon is None or not self._bus.tells_commands or daemon.is_lift_dead == was_dead:
            return None
        return self._bench.with_lift_sensor(is_dead=not was_dead)

    def run(self, stop: Event) -> None:
        """Serve until `stop` is set.

        Raises `UserError` or `RunError` for a link that fails, and for files that cannot be written at the end.
        """
        with ExitStack() as stack:
            opening = LinkOpening(self._bench, self._bus, self._tell, stop, self._notifier.alive)
            try:
                opening.tell_other_senders()
                links = [stack.enter_context(link) for link in opening.links()]
            except StoppedError:
                self._log.say(Topic.STOP, "stopped while it waited for the interface")
                return
            daemon = Daemon(
                self._bench,
                self._bus,
                links,
                self._knowledge,
                [self._tell, *self._keeper.listeners, *([self._evidence.hear] if self._evidence else [])],
                self._notifier.alive,
                lambda: self._keeper.failures + self._log.lost,
                on_thread=self._on_thread,
                evidence_kept=lambda: self._evidence.kept if self._evidence else 0,
            )
            self.snapshots.watch(daemon)
            self._daemon = daemon
            self._log.say(Topic.START, "ready")
            stack.callback(self._farewell, daemon)  # whatever fails: the link, or the last write
            if self._evidence is not None:
                self._evidence.watch(daemon.core)
                stack.enter_context(self._evidence.keeping())
            with self._keeper.keeping(lambda: daemon.core.knowledge):
                daemon.run(stop)

    def _tell(self, news: News) -> None:
        self.snapshots.hear(news)
        self._teller.hear(news)

    @property
    def _buses(self) -> str:
        """Interfaces and channels of its buses."""
        links = self._bench.config.buses
        return ", ".join(f"{links[n].config.interface} {links[n].label}" for n in sorted(buses_of(self._bus)))

    def _announce(self) -> None:
        injector, bus, say = self._bench.injector, self._bus, self._log.say
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
        say, core = self._log.say, daemon.core
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
            "log lines lost": self._log.lost,
        }
        more = "".join(f", {count} {what}" for what, count in spoilt.items() if count)
        say(
            Topic.STOP,
            f"stopped after {counters.samples} samples, {counters.injections} injections; {counters.lost_samples} "
            f"samples lost, {daemon.dropped} frames dropped, {daemon.unsent} results unsent, "
            f"{daemon.arrivals.foreign_frames} frames of other senders, {counters.adoptions} corrections adopted, "
            f"{counters.late_adoptions} late, {counters.passed_over} events not learned from in time{more}",
        )


def serve_beside(service: InjectorService, stop: Event, meanwhile: Callable[[Event], None] | None) -> None:
    """Serve in a thread of its own until `stop` is set, or it ends, which sets it; raises what ended it.

    meanwhile: is done in this thread until then.
    """
    failures: list[BaseException] = []

    def run() -> None:
        try:
            service.run(stop)
        except BaseException as error:
            failures.append(error)
        finally:
            stop.set()

    thread = Thread(target=run, name="daemon", daemon=True)
    thread.start()
    try:
        if meanwhile is not None:
            meanwhile(stop)
    finally:
        while thread.is_alive():  # a signal that another thread took wakes no join without an end
            thread.join(_TURN)
    for failure in failures:
        raise failure


@dataclass
class Serving:
    """Things that outlast a change of the bench file. screen: of the view, if there is one; processor: of the loop.

    learned: by model, so that nothing is lost where no file keeps it, and what was learned with a model is there
    again where taking over another one is undone.
    """

    screen: Console | None
    options: RunOptions
    log: ServiceLog
    stop: StopRequest
    own: Processors
    processor: int | None
    priority: int
    reloading: Reloading
    notifier: Notifier = field(default_factory=Notifier)
    learned: dict[str, Knowledge | None] = field(default_factory=dict)
    is_ready: bool = False
    has_observed: bool = False
    """Whether the last bench was in service when it ended."""

    def serve(self, bench: Bench) -> Bench | None:
        """Serve a bench until asked to stop, or another is to take its place, which is returned.

        Raises `UserError` and `RunError`; where another takes its place, what could not be saved is only said.
        """
        self.has_observed = False
        with ExitStack() as stack:
            service = self._service(bench, stack)
            self.reloading.listen(bench, self.options.state, service.snapshots.answer)
            if not self.is_ready:
                self._get_ready()
            if self.stop.is_set():
                self.log.say(Topic.STOP, "stopped while it was starting")
                return None
            with self.reloading.watching(bench, service) as (ended, successor):
                try:
                    serve_beside(service, ended, service.drawing)
                except UnsavedError as error:
                    if self.stop.is_set() or successor() is None:
                        raise
                    self.reloading.unsaved = str(error)
                    self.say(f"warning: {error}\n  remedy: {UNSAVED}")
                finally:
                    self.has_observed = service.is_observing
        self.learned[service.model] = service.learned
        return None if self.stop.is_set() else successor()

    def say(self, text: str) -> None:
        """Logs a line about the start."""
        self.log.say(Topic.START, text)

    def _service(self, bench: Bench, stack: ExitStack) -> InjectorService:
        fitted, tell = bench.injector, partial(self.log.say, Topic.KEPT)
        keeper = stack.enter_context(keeper_of(bench, self.options.state, self.options.journal, tell))
        evidence: EvidenceKeeper | None = None
        if fitted.evidence is not None:
            from observer_rt.daemon.evidence import evidence_keeper  # optional: [evidence] folder

            evidence = stack.enter_context(evidence_keeper(fitted, fitted.evidence, tell))
        service = InjectorService(
            bench,
            map_bus(bench),
            keeper,
            self.log,
            self.notifier,
            self.screen,
            evidence,
            self.learned.get(model_hash(fitted.parameters)),
            partial(hurry, self.processor, self.priority),
        )
        if any(link.config.interface == "virtual" for link in bench.config.buses):
            self.say("the virtual bus ends at this process: nothing will come in (vcan0 reaches other programs)")
        return service

    def _get_ready(self) -> None:
        """Claim what the machine grants."""
        if self.stop.is_set():
            return
        self.notifier.ready()
        granted = lock_memory(rights(self.priority))
        leave_to_loops(self.own)
        loop = replace(self.own, own=() if self.processor is None else (self.processor,))
        self.say(f"{granted.as_text()}, {loop.as_text()}")
        if self.own.trouble:
            self.say(f"warning: {self.own.trouble}\n  remedy: {REMEDY}")
        gc.collect()
        gc.freeze()  # a full collection would stop every Python loop for tens of milliseconds
        self.is_ready = True


def serve(read: Callable[[], Bench], options: RunOptions, console: Console) -> None:
    """Run the daemon of one injector until SIGINT or SIGTERM, with files instead of those the bench file names.

    read: the bench as its file is now, with all its injectors; raises `UserError` for one that may not start.
    Raises `UserError` for files that do not fit, `RunError` when links fail.
    """

    def alone(all_injectors: Bench) -> Bench:
        bench = all_injectors.of(options.injector)
        kept = {path.resolve() for path in kept_files(bench.injector, options.state, options.journal) if path}
        if options.log is not None and options.log.resolve() in kept:
            raise UserError(f"--log {options.log}", "is the learned state or the journal", "name another file")
        return bench

    all_injectors = read()
    bench = alone(all_injectors)
    with ExitStack() as stack:
        has_view = options.view and console.is_terminal
        log = stack.enter_context(_log(options, console, has_view))
        if options.view and not has_view:
            log.say(Topic.START, "no terminal for the view: one line an injection instead")
        # from here on, so that a signal while starting is not lost
        stop = stack.enter_context(stop_on_signals(reloads=True))
        stack.callback(gc.unfreeze)
        own = processors(all_injectors.config.realtime.cpus, len(all_injectors.injectors))
        processor, priority = own.of(bench.injector.file.number), bench.config.realtime.priority
        reloading = Reloading(stop, lambda: alone(read()), partial(log.say, Topic.START), stack)
        screen = console if has_view else None
        serving = Serving(screen, options, log, stop, own, processor, priority, reloading)
        stack.callback(serving.notifier.stopping)
        before: Bench | None = None
        now: Bench | None = bench
        while now is not None:
            try:
                before, now = now, serving.serve(now)
            except ObserverError as error:
                if before is None or serving.has_observed:
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
