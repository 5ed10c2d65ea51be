"""The daemon's service of one injector: waits for its interfaces, observes it, says at the end what it did."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from threading import Event, Thread
from typing import TYPE_CHECKING

from rich.console import Console

from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.links.descriptor import IdleLink
from observer_rt.bus.links.link import Link, LinkDownError
from observer_rt.bus.links.opening import first_heard, open_link
from observer_rt.bus.mapping.bus_map import BusMap, map_bus
from observer_rt.config.bench import Bench
from observer_rt.daemon.arrivals import message_text, watched_messages
from observer_rt.daemon.daemon import Daemon
from observer_rt.daemon.input_watch import OTHER_SENDER
from observer_rt.daemon.keeper import Keeper
from observer_rt.daemon.log import EventLogger, ServiceLog
from observer_rt.daemon.notifier import Notifier
from observer_rt.daemon.snapshot_keeper import SnapshotKeeper
from observer_rt.daemon.state_file import knowledge_beside, model_hash, restored_knowledge
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.reports.news import Listener, News, Notice
from observer_rt.engine.service.injector import bench_constants, doubt_about_fit
from observer_rt.engine.words import Topic
from observer_rt.foundation.units import MICROSECOND

if TYPE_CHECKING:
    from observer_rt.daemon.evidence_keeper import EvidenceKeeper

_TURN = 0.2  # s between two looks at what signals ask for
REOPEN = 0.25  # s between two tries to open an interface


class StoppedError(Exception):
    """The service was asked to stop while it waited for an interface."""


@dataclass(frozen=True)
class LinkOpening:
    """Opens the links of an injector; on_alive: called while it waits.

    Its methods raise `StoppedError` when `stop` is set, `UserError` or `RunError` where waiting does not help.
    """

    bench: Bench
    bus_map: BusMap
    tell: Listener
    stop: Event
    on_alive: Callable[[], None]

    def links(self) -> Iterator[Link]:
        """Opens the links of its own buses in order, as soon as it can; own identifiers are listened to, too."""
        used = self.bus_map.buses
        for number, named in enumerate(self.bench.config.buses):
            if number not in used:
                yield IdleLink()
                continue
            # where only results are sent they are read all the same: a link that reads nothing gets no error frames
            link = self._wait_for_link(number, watched_messages(self.bus_map), len(used) > 1)
            yield link
            on = f"{named.label}: " if len(used) > 1 else ""
            self.tell(Notice(Topic.START, f"{on}time stamps: {link.stamp_source}", is_over=True))
            for warning in link.warnings:
                self.tell(Notice(Topic.LINK, warning))

    def report_other_senders(self) -> None:
        """Listen a moment, before anything is sent, for other nodes that send the messages of this service."""
        with ExitStack() as stack, suppress(LinkDownError):  # which the daemon waits for
            links = {}
            for number in {layout.bus for layout in self.bus_map.sent}:
                links[number] = stack.enter_context(self._wait_for_link(number, self.bus_map.sent, False))
            if sender := first_heard(links, self.stop):
                on = sender.bus, sender.frame.frame_id
                layout = next(layout for layout in self.bus_map.sent if (layout.bus, layout.frame_id) == on)
                text = f"another node sends {message_text(self.bus_map, layout)} already\n  remedy: {OTHER_SENDER}"
                self.tell(Notice(Topic.SENDER, text))

    def _wait_for_link(self, number: int, messages: Iterable[MessageLayout], computer_time: bool) -> Link:
        """The link of a bus, opened once its interface is there, for messages on it."""
        named = self.bench.config.buses[number]
        wanted = list({(layout.frame_id, layout.is_extended): None for layout in messages if layout.bus == number})
        config = named.config
        waiting_for = ""
        while True:
            try:
                link = open_link(config.interface, config.channel, config.fd, wanted, computer_time, config.bit_rates)
            except LinkDownError as error:
                if str(error) != waiting_for:
                    waiting_for = str(error)
                    self.tell(Notice(Topic.LINK, f"waiting for the interface: {waiting_for}"))
            else:
                if waiting_for:
                    self.tell(Notice(Topic.LINK, f"{named.label} is there", is_over=True))
                return link
            self.on_alive()
            if self.stop.wait(REOPEN):
                raise StoppedError


class InjectorService:
    """Waits for the injector's interfaces, then observes it, until asked to stop."""

    def __init__(
        self,
        bench: Bench,
        keeper: Keeper,
        log: ServiceLog,
        notifier: Notifier,
        screen: Console | None,
        evidence: "EvidenceKeeper | None",
        learned: Knowledge | None,
        on_thread: Callable[[], object],
    ) -> None:
        """bench: with one injector; screen: terminal of the view, None without one; on_thread: see `Daemon`.

        learned: before the bench file was changed, else from the file of the state, else from that beside the
        injector file. Logs what that is, and what it will observe.
        """
        injector = bench.injector
        self._bench = bench
        self._bus = map_bus(bench)
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
        self._log_start()
        self._evidence = evidence
        self.snapshots = SnapshotKeeper(bench)
        self.drawing: Callable[[Event], None] | None = None
        """Draws the view until the event is set; None without one."""
        if screen is not None:
            from observer_rt.daemon.view import View, draw  # optional: --view

            title = " ".join(filter(None, ("observer_rt", injector.name)))
            self.drawing = partial(draw, View(f"{title}: {self._buses}", self.snapshots.take), console=screen)
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
        """The bench with a lift sensor that died or came back; None where the bench is right, or needs the lift."""
        daemon, was_dead = self._daemon, self._bench.injector.is_lift_dead
        if daemon is None or not self._bus.tells_commands or daemon.is_lift_dead == was_dead:
            return None
        return self._bench.with_lift_sensor(is_dead=not was_dead)

    def run(self, stop: Event) -> None:
        """Serve until `stop` is set. Raises `UserError` or `RunError` for a failing link, or files not written."""
        with ExitStack() as stack:
            opening = LinkOpening(self._bench, self._bus, self._tell, stop, self._notifier.alive)
            try:
                opening.report_other_senders()
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
            stack.callback(self._log_summary, daemon)  # whatever fails: the link, or the last write
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
        links = self._bench.config.buses
        return ", ".join(f"{links[n].config.interface} {links[n].label}" for n in sorted(self._bus.buses))

    def _log_start(self) -> None:
        injector, bus, say = self._bench.injector, self._bus, self._log.say
        constants = bench_constants(injector)
        inputs, outputs = (
            ", ".join(f"{bus.name_of(layout)} 0x{layout.frame_id:X}" for layout in layouts)
            for layouts in (bus.received, bus.sent)
        )
        rate = injector.sample_rate
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

    def _log_summary(self, daemon: Daemon) -> None:
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
        counts = {
            "frames with a wrong CRC": counters.crc_errors,
            "of wrong length": counters.length_errors,
            "twice": counters.repeated_frames,
            "out of sequence": counters.sequence_errors,
            "log lines lost": self._log.lost,
        }
        more = "".join(f", {count} {what}" for what, count in counts.items() if count)
        say(
            Topic.STOP,
            f"stopped after {counters.samples} samples, {counters.injections} injections; {counters.lost_samples} "
            f"samples lost, {daemon.dropped} frames dropped, {daemon.unsent} results unsent, "
            f"{daemon.arrivals.foreign_frames} frames of other senders, {counters.adoptions} corrections adopted, "
            f"{counters.late_adoptions} late, {counters.unlearned_events} events not learned from in time{more}",
        )


def serve_in_thread(service: InjectorService, stop: Event, meanwhile: Callable[[Event], None] | None) -> None:
    """Serve in a thread until `stop` is set, or it ends, and do `meanwhile`; raises the thread's error."""
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
