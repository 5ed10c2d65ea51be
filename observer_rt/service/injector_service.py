"""One injector's daemon with all that is its own: files, links, lines of the log, a view."""

import threading
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import ExitStack

from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.config.bench import Bench
from observer_rt.foundation.units import MICROSECOND
from observer_rt.service.compiled.constants import bench_constants
from observer_rt.service.core.learners import doubt_about_fit
from observer_rt.service.daemon import Daemon
from observer_rt.service.keeping.keeper import Keeper
from observer_rt.service.keeping.state_file import model_hash, restored_knowledge
from observer_rt.service.log import Voice
from observer_rt.service.opening import StoppedError, buses_of, open_links, tell_other_senders
from observer_rt.service.reports.news import News, Teller
from observer_rt.service.screen.view import View
from observer_rt.service.sharing import Shared
from observer_rt.service.words import Topic


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
            lambda text: voice.say(Topic.KEPT, text),
        )
        self._announce()
        self.screen = View(voice.named(f"observer_rt: {self._buses}"), injector)
        self._teller = Teller(voice, shared.notifier, bench_constants(injector).coefficients, shared.once)

    @property
    def name(self) -> str:
        """Of the injector, empty where the bench has one."""
        return self._bench.injector.name

    def run(self, stop: threading.Event, learning: Executor, on_alive: Callable[[], None]) -> None:
        """Serve until `stop` is set; learning, on_alive: as of `Daemon`.

        Raises `UserError` or `RunError` for a link that fails, and for files that cannot be written at the end.
        """
        with ExitStack() as stack:
            try:
                buses = self._shared.buses
                tell_other_senders(self._bench, self._bus, buses, self._tell, stop, on_alive)
                opened = open_links(self._bench, self._bus, buses, self._tell, stop, on_alive)
                links = [stack.enter_context(link) for link in opened]
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
            self.screen.watch(daemon)
            self._voice.say(Topic.START, "ready")
            with self._keeper.keeping(lambda: daemon.core.knowledge):
                daemon.run(stop)
            self._farewell(daemon)

    def tell_end(self, failure: BaseException) -> None:
        """Say that this injector is not served any more, while others are."""
        self._voice.say(Topic.STOP, f"warning: ended, the other injectors go on: {failure}")

    def _tell(self, news: News) -> None:
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
        if core.energizing is not None:
            say(Topic.STOP, f"energizing: {core.energizing.as_text()}")
        counters = core.counters
        lost = f", {self._voice.log.lost} log lines lost" if self._voice.log.lost else ""
        say(
            Topic.STOP,
            f"stopped after {counters.samples} samples, {counters.injections} injections; {counters.lost_samples} "
            f"samples lost, {daemon.dropped} frames dropped, {daemon.unsent} results unsent, "
            f"{daemon.arrivals.foreign_frames} frames of other senders, {counters.adoptions} phi adopted, "
            f"{counters.late_adoptions} late, {counters.passed_over} events not learned from in time{lost}",
        )
