"""`observer-rt run`: the daemon of one injector with its files, links, log and view."""

import gc
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

from rich.console import Console

from observer_rt.config.bench import Bench
from observer_rt.daemon.injector_service import InjectorService, serve_in_thread
from observer_rt.daemon.keeper import UnsavedError, keeper_of, kept_files
from observer_rt.daemon.log import ServiceLog
from observer_rt.daemon.notifier import Notifier
from observer_rt.daemon.reloading import Reloading
from observer_rt.daemon.rights import REMEDY, Processors, hurry, leave_to_loops, lock_memory, processors, rights
from observer_rt.daemon.state_file import model_hash
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.words import Topic
from observer_rt.foundation.errors import ObserverError, UserError, file_errors
from observer_rt.foundation.options import RunOptions
from observer_rt.foundation.outputs import SERVICE_LOG, check_own_file
from observer_rt.foundation.stop_request import StopRequest, stop_on_signals

if TYPE_CHECKING:
    from observer_rt.daemon.evidence_keeper import EvidenceKeeper

UNSAVED = "the reload goes on; what was learned with the model before is kept by this process only, for the way back"


@dataclass
class Serving:
    """State that outlasts a change of the bench file; learned: by model, for when another one is undone."""

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
        """Serve a bench until asked to stop; returns the bench to serve next. Raises `UserError`, `RunError`."""
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
                    serve_in_thread(service, ended, service.drawing)
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
        injector, tell = bench.injector, partial(self.log.say, Topic.KEPT)
        keeper = stack.enter_context(keeper_of(bench, self.options.state, self.options.journal, tell))
        evidence: EvidenceKeeper | None = None
        if injector.evidence is not None:
            from observer_rt.daemon.evidence_keeper import evidence_keeper  # optional: [evidence] folder

            evidence = stack.enter_context(evidence_keeper(injector, injector.evidence, tell))
        service = InjectorService(
            bench,
            keeper,
            self.log,
            self.notifier,
            self.screen,
            evidence,
            self.learned.get(model_hash(injector.parameters)),
            partial(hurry, self.processor, self.priority),
        )
        if any(link.config.interface == "virtual" for link in bench.config.buses):
            self.say("the virtual bus ends at this process: nothing will come in (vcan0 reaches other programs)")
        return service

    def _get_ready(self) -> None:
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
    """Run the daemon of one injector until SIGINT or SIGTERM, with files instead of the bench file's.

    read: gives the bench as now, or `UserError`. Raises `UserError` for unfit files, `RunError` when links fail.
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
        stop = stack.enter_context(stop_on_signals(reloads=True))  # first, not to lose a signal while starting
        stack.callback(gc.unfreeze)
        own = processors(all_injectors.config.realtime.cpus, len(all_injectors.injectors))
        processor, priority = own.of(bench.injector.file.number), bench.config.realtime.priority
        reloading = Reloading(stop, lambda: alone(read()), partial(log.say, Topic.START), stack)
        serving = Serving(console if has_view else None, options, log, stop, own, processor, priority, reloading)
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
