"""`observer-rt run`: the daemon with its signals, its learned state and its view."""

import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path

from rich.console import Console, RenderableType
from rich.live import Live

from observer_rt.bus.links.link import Link
from observer_rt.bus.links.open import open_link
from observer_rt.bus.mapping.bus_map import BusMap, map_bus
from observer_rt.config.bench import Bench
from observer_rt.estimation.scalars import NOZZLE
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND, MILLIGRAM, ZERO_CELSIUS
from observer_rt.observer.learning.knowledge import Knowledge
from observer_rt.service.compiled.constants import bench_constants
from observer_rt.service.daemon import Daemon
from observer_rt.service.keeping.keeper import Keeper, keeper_of
from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.reports.news import LinkNews, News
from observer_rt.service.state_file import load_knowledge, model_hash
from observer_rt.service.view import View
from observer_rt.service.warm_up import warm_up
from observer_rt.terminal.console import say, say_if_compiling
from observer_rt.terminal.stop import stop_on_signals

FRAMES_PER_SECOND = 8  # of the view


def serve(bench: Bench, state: Path | None, journal: Path | None, view: bool, console: Console) -> None:
    """Run the daemon until SIGINT or SIGTERM.

    state, journal: files to keep, instead of those the bench file names.
    Raises `UserError` for files that do not fit, `RunError` when the link fails.
    """
    with keeper_of(bench, state, journal, partial(say, console)) as keeper:
        _serve(bench, keeper, view, console)


def _serve(bench: Bench, keeper: Keeper, view: bool, console: Console) -> None:
    if view and not console.is_terminal:
        say(console, "no terminal for the view: one line an injection instead")
        view = False
    bus, injector = map_bus(bench), bench.injector
    model = model_hash(injector.parameters)
    knowledge = restored_knowledge(keeper.state, model, injector.parameters.scaling.pressure, console)
    _announce(bench, bus, console)
    screen = View(f"observer_rt: {_buses(bench)}", injector.config.sampling.rate_hz)

    def say_news(news: News) -> None:
        if isinstance(news, InjectionReport):
            say(console, _line(news))
        else:
            say(console, news.as_text())

    def show_news(news: News) -> None:
        screen.hear(news)
        if isinstance(news, LinkNews):
            say(console, news.text)

    # from here on, so that a signal while compiling is neither lost nor an interrupt in the middle of it
    with stop_on_signals() as stop:
        say_if_compiling(console)
        warm_up(bench, bus)
        with ExitStack() as stack:
            links = [stack.enter_context(each) for each in _opened(bench, bus, console)]
            daemon = Daemon(
                bench, bus, links, knowledge, [show_news if view else say_news, *keeper.listeners]
            )
            screen.watch(daemon)
            stack.enter_context(keeper.keeping(daemon.core))
            say(console, "ready")
            if view:
                _run_with_view(daemon, screen, stop, console)
            else:
                daemon.run(stop)
    _farewell(daemon, console)


def restored_knowledge(
    path: Path | None, model: str, pressure_scale: float, console: Console, set_aside: bool = True
) -> Knowledge | None:
    """What a state file holds for this model, saying on the console what became of it; None without one.

    A state learned from no event is no reason to trust the first results sooner: it counts as none.
    """
    if path is None:
        return None
    restored = load_knowledge(path, model, pressure_scale, set_aside)
    say(console, restored.message)
    return restored.knowledge if restored.knowledge and restored.knowledge.events else None


def _opened(bench: Bench, bus: BusMap, console: Console) -> Iterator[Link]:
    """The links of all buses, opened one after another, with what is to be said of them."""
    links = bench.config.buses
    for number, named in enumerate(links):
        config = named.config
        link = open_link(config.interface, config.channel, config.fd, bus.received_on(number), len(links) > 1)
        yield link
        on = f"{named.label}: " if len(links) > 1 else ""
        say(console, f"{on}time stamps: {link.stamp_source}")
        for warning in link.warnings:
            say(console, f"warning: {warning}")


def _buses(bench: Bench) -> str:
    """Interfaces and channels of all buses."""
    return ", ".join(f"{link.config.interface} {link.label}" for link in bench.config.buses)


def _announce(bench: Bench, bus: BusMap, console: Console) -> None:
    constants = bench_constants(bench.injector)
    inputs = ", ".join(map(bus.name_of, bus.received))
    outputs = ", ".join(map(bus.name_of, bus.sent))
    rate = bench.injector.config.sampling.rate_hz
    lookahead = constants.timing.lookahead
    say(
        console,
        f"{_buses(bench)}: {inputs} at {rate:g} Hz -> {outputs}\n"
        f"{constants.substeps} integration steps a sample, look-ahead {lookahead} samples "
        f"({lookahead / rate / MICROSECOND:g} us)",
    )
    if any(link.config.interface == "virtual" for link in bench.config.buses):
        say(
            console,
            "the virtual bus ends at this process: nothing will come in (vcan0 reaches other programs)",
        )


def _run_with_view(daemon: Daemon, screen: View, stop: threading.Event, console: Console) -> None:
    """The loop in a thread of its own, the view in this one; an error of the loop is raised here."""
    failure: list[BaseException] = []

    def loop() -> None:
        try:
            daemon.run(stop)
        except BaseException as error:
            failure.append(error)
            stop.set()

    serving = threading.Thread(target=loop, name="daemon")
    serving.start()
    try:
        draw(screen, stop, console)
    finally:
        stop.set()
        serving.join()
    if failure:
        raise failure[0]


def draw(screen: View, until: threading.Event, console: Console) -> None:
    """Draw the view on a terminal until the event is set."""

    def picture() -> RenderableType:
        return screen.render(time.monotonic_ns(), console.width, console.height)

    with Live(picture(), console=console, auto_refresh=False) as live:
        while not until.wait(1 / FRAMES_PER_SECOND):
            live.update(picture(), refresh=True)
        live.update(picture(), refresh=True)


def _line(report: InjectionReport) -> str:
    verdict = "valid" if report.valid else f"not valid: {report.reason.name}"
    temperature = report.fuel_temperature
    fuel = "" if temperature is None else f"fuel {temperature - ZERO_CELSIUS:.1f} degC, "
    return (
        f"injection {report.number} at index {report.start_index}: {report.mass / MILLIGRAM:.2f} mg, "
        f"rail {report.rail_pressure / MEGAPASCAL:.1f} MPa, v_H {report.indicators[NOZZLE].value:+.3f}, "
        f"phi {report.phi_version}, {fuel}{verdict}"
        + (f", {report.commanded.as_text()}" if report.commanded else "")
    )


def _farewell(daemon: Daemon, console: Console) -> None:
    for timing in daemon.core.timing:
        say(console, timing.as_text())
    if daemon.core.energizing is not None:
        say(console, f"energizing: {daemon.core.energizing.as_text()}")
    counters = daemon.core.counters
    say(
        console,
        f"stopped after {counters.samples} samples, {counters.injections} injections; {counters.lost_samples} "
        f"samples lost, {daemon.dropped} frames dropped, {daemon.unsent} results unsent, "
        f"{counters.adoptions} phi adopted, {counters.late_adoptions} late",
    )
