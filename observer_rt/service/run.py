"""`observer-rt run`: the daemons of a bench with their signals, their log, their learned state and their view."""

import gc
import sys
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Event

from rich.console import Console

from observer_rt.bus.mapping.bench_map import BenchMap, map_bench
from observer_rt.config.bench import Bench
from observer_rt.foundation.compilation import compiled_code
from observer_rt.foundation.file_errors import file_errors
from observer_rt.service.injector_service import InjectorService
from observer_rt.service.keeping.keeper import keeper_of
from observer_rt.service.log import ServiceLog, Voice
from observer_rt.service.notify import Notifier
from observer_rt.service.overview import Overview
from observer_rt.service.processors import REMEDY, Processors, leave_to_loops, processors
from observer_rt.service.rights import lock_memory, rights
from observer_rt.service.sharing import Shared, refuse_shared, shared_buses
from observer_rt.service.show import Screen, draw
from observer_rt.service.side_by_side import serve_side_by_side
from observer_rt.service.warm_up import warm_up
from observer_rt.service.words import Topic
from observer_rt.terminal.compiling import tell_compiling
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
