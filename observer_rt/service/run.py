"""`observer-rt run`: the daemon with its signals, its log, its learned state and its view."""

import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from observer_rt.bus.mapping.bus_map import BusMap, map_bus
from observer_rt.config.bench import Bench
from observer_rt.foundation.compilation import is_compiled
from observer_rt.foundation.file_errors import file_errors
from observer_rt.foundation.units import MICROSECOND
from observer_rt.observer.learning.knowledge import Knowledge
from observer_rt.service.compiled.constants import bench_constants
from observer_rt.service.core.learners import doubt_about_fit
from observer_rt.service.daemon import Daemon
from observer_rt.service.keeping.keeper import keeper_of
from observer_rt.service.log import ServiceLog
from observer_rt.service.notify import Notifier
from observer_rt.service.opening import StoppedError, open_links, tell_other_senders
from observer_rt.service.reports.news import News
from observer_rt.service.reports.telling import Teller
from observer_rt.service.rights import lock_memory, rights
from observer_rt.service.show import run_with_view
from observer_rt.service.state_file import load_knowledge, model_hash
from observer_rt.service.view import View
from observer_rt.service.warm_up import warm_up
from observer_rt.service.words import Topic
from observer_rt.terminal.console import COMPILING
from observer_rt.terminal.destinations import check_destination
from observer_rt.terminal.stop import stop_on_signals


@dataclass(frozen=True)
class RunOptions:
    """Options of the command: state, log, journal: files; records: injections as JSON lines on stdout."""

    state: Path | None = None
    view: bool = False
    records: bool = False
    log: Path | None = None
    journal: Path | None = None


def serve(bench: Bench, options: RunOptions, console: Console) -> None:
    """Run the daemon until SIGINT or SIGTERM.

    state, journal: files to keep, instead of those the bench file names.
    Raises `UserError` for files that do not fit, `RunError` when the link fails.
    """
    bus, injector = map_bus(bench), bench.injector
    has_view = options.view and console.is_terminal
    notifier = Notifier()
    with ExitStack() as stack:
        log = stack.enter_context(_log(options, console, has_view))
        if options.view and not has_view:
            log.say(Topic.START, "no terminal for the view: one line an injection instead")
        model = model_hash(injector.parameters)
        pressure_scale = injector.parameters.scaling.pressure

        def tell_kept(text: str) -> None:
            log.say(Topic.KEPT, text)

        keeper = stack.enter_context(keeper_of(bench, options.state, options.journal, tell_kept))
        knowledge = restored_knowledge(keeper.state, model, pressure_scale, tell_kept)
        _announce(bench, bus, log)
        screen = View(f"observer_rt: {_buses(bench)}", injector)
        teller = Teller(log, notifier, bench_constants(injector).coefficients)

        def tell(news: News) -> None:
            screen.hear(news)
            teller.hear(news)

        # from here on, so that a signal while compiling is neither lost nor an interrupt in the middle of it
        stop = stack.enter_context(stop_on_signals())
        if not is_compiled():
            log.say(Topic.START, COMPILING)
        warm_up(bench, bus)
        notifier.ready()
        try:
            tell_other_senders(bench, bus, tell, stop, notifier.alive)
            links = [stack.enter_context(link) for link in open_links(bench, bus, tell, stop, notifier.alive)]
        except StoppedError:
            log.say(Topic.STOP, "stopped while it waited for the interface")
            return

        def failed_writes() -> int:
            return keeper.failures + log.lost

        hearers = [tell, *keeper.listeners]
        daemon = Daemon(bench, bus, links, knowledge, hearers, notifier.alive, failed_writes)
        screen.watch(daemon)
        granted = rights()
        lock_memory(granted)
        log.say(Topic.START, granted.as_text())
        log.say(Topic.START, "ready")
        with keeper.keeping(daemon.core):
            try:
                if has_view:
                    run_with_view(daemon, screen, stop, console)
                else:
                    daemon.run(stop)
            finally:
                notifier.stopping()
        _farewell(daemon, log)


def restored_knowledge(
    path: Path | None,
    model: str,
    pressure_scale: float,
    tell: Callable[[str], None],
    set_aside: bool = True,
) -> Knowledge | None:
    """What a state file holds for this model, telling what became of it; None without one.

    A state learned from no event is no reason to trust the first results sooner: it counts as none.
    """
    if path is None:
        return None
    restored = load_knowledge(path, model, pressure_scale, set_aside)
    tell(restored.message)
    return restored.knowledge if restored.knowledge and restored.knowledge.events else None


def _log(options: RunOptions, console: Console, has_view: bool) -> ServiceLog:
    """The log of the options. Raises `UserError` for a file that cannot be written."""
    if options.log is not None:
        check_destination("--log", options.log)
        with file_errors(options.log):
            options.log.touch()
    return ServiceLog(console, options.log, sys.stdout if options.records else None, quiet=has_view)


def _buses(bench: Bench) -> str:
    """Interfaces and channels of all buses."""
    return ", ".join(f"{link.config.interface} {link.label}" for link in bench.config.buses)


def _announce(bench: Bench, bus: BusMap, log: ServiceLog) -> None:
    constants = bench_constants(bench.injector)
    inputs = ", ".join(map(bus.name_of, bus.received))
    outputs = ", ".join(map(bus.name_of, bus.sent))
    rate = bench.injector.config.sampling.rate_hz
    lookahead = constants.timing.lookahead
    log.say(
        Topic.START,
        f"{_buses(bench)}: {inputs} at {rate:g} Hz -> {outputs}\n"
        f"{constants.substeps} integration steps a sample, look-ahead {lookahead} samples "
        f"({lookahead / rate / MICROSECOND:g} us)",
    )
    if doubt := doubt_about_fit(bench.injector):
        log.say(Topic.START, f"warning: {doubt.text}; remedy: {doubt.remedy}")
    if any(link.config.interface == "virtual" for link in bench.config.buses):
        log.say(
            Topic.START,
            "the virtual bus ends at this process: nothing will come in (vcan0 reaches other programs)",
        )


def _farewell(daemon: Daemon, log: ServiceLog) -> None:
    for timing in daemon.core.timing:
        log.say(Topic.STOP, timing.as_text())
    if daemon.core.energizing is not None:
        log.say(Topic.STOP, f"energizing: {daemon.core.energizing.as_text()}")
    counters = daemon.core.counters
    lost = f", {log.lost} log lines lost" if log.lost else ""
    log.say(
        Topic.STOP,
        f"stopped after {counters.samples} samples, {counters.injections} injections; {counters.lost_samples} "
        f"samples lost, {daemon.dropped} frames dropped, {daemon.unsent} results unsent, "
        f"{daemon.arrivals.foreign_frames} frames of other senders, {counters.adoptions} phi adopted, "
        f"{counters.late_adoptions} late, {counters.passed_over} events not learned from in time{lost}",
    )
