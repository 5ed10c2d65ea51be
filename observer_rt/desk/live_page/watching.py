"""All injectors of a bench, listened to on their buses, or in a log at its own pace, by a thread of its own."""

import math
import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from observer_rt.bus.can_frame import frame_key
from observer_rt.bus.links.link import SWITCHED, BusFrame, FdFlags, Frame, Link, LinkDownError
from observer_rt.bus.links.opening import open_link
from observer_rt.bus.links.receiver import EnduringReading
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.bus.mapping.output_messages import frame_time
from observer_rt.config.bench import Bench
from observer_rt.config.bench_file import LinkConfig, NamedLink
from observer_rt.daemon.input_monitoring.arrivals import SECOND
from observer_rt.daemon.link_opening import buses_of
from observer_rt.desk.live_page.injector import Fault, Seen, WatchedInjector
from observer_rt.files.channels import chosen_channels
from observer_rt.files.formats import open_log
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors

Taker = Callable[[BusFrame, int], None]
"""Takes a frame that came at a time [ns since 1970]."""
_WAIT = 0.05  # s that the listener is deaf to its end
OVER = 1_000_000_000  # ns
_FULL_REMEDY = "a source that sends windows, or more buses; are the bit rates those of the bench file?"
FULL = 1.0  # share of the time that frames take, from which on none more has room


class FrameSource(ABC):
    """Gives frames until asked to stop."""

    is_live = False
    """Else time is that of the frames."""

    @property
    def dropped(self) -> int:
        """Frames that were lost before they were given, where anybody can tell."""
        return 0

    @property
    def down(self) -> Mapping[int, str]:
        """Buses that are down, with why."""
        return {}

    @abstractmethod
    def run(self, take: Taker, stop: threading.Event) -> None:
        """Give frames. Raises `ObserverError` when it cannot go on."""


class LiveSource(FrameSource):
    """The buses of a bench that its injectors use, unfiltered."""

    is_live = True

    def __init__(self, bench: Bench) -> None:
        self._links = bench.config.buses
        self._buses = sorted(used_buses(bench))
        self._reading: EnduringReading | None = None  # until it runs

    @property
    def dropped(self) -> int:
        """Frames that the kernel or an interface lost."""
        return 0 if self._reading is None else self._reading.dropped

    @property
    def down(self) -> Mapping[int, str]:
        """Buses that are down, with why."""
        if self._reading is None:
            return {}
        return {self._buses[place]: why for place, why in self._reading.down.items()}

    def run(self, take: Taker, stop: threading.Event) -> None:
        """Listen until asked to stop. Raises `RunError` when a link cannot be opened, or fails for good."""
        with ExitStack() as stack:
            links = [stack.enter_context(_AwaitedLink(self._links[bus].config)) for bus in self._buses]
            self._reading = EnduringReading(links)
            stack.callback(self._reading.close)
            while not stop.is_set():
                came = self._reading.receive(_WAIT)
                if came is not None:
                    take(BusFrame(self._buses[came.bus], came.frame), time.time_ns())


class _AwaitedLink(Link):
    """A link to listen by; as long as its interface is not there yet, it is down. Raises as `open_link`."""

    def __init__(self, config: LinkConfig) -> None:
        self._config = config
        self._link: Link | None = None
        self._why = ""
        with suppress(LinkDownError):
            self.reconnect()

    def reconnect(self) -> None:
        if self._link is not None:
            self._link.reconnect()
            return
        config = self._config
        try:
            self._link = open_link(config.interface, config.channel, config.fd, computer_time=True)
        except LinkDownError as error:
            self._why = str(error)
            raise

    def receive(self, timeout_s: float) -> Frame | None:
        if self._link is None:
            raise LinkDownError(self._why)
        return self._link.receive(timeout_s)

    def send(
        self, frame_id: int, payload: bytes, is_extended: bool, is_fd: bool, flags: FdFlags = SWITCHED
    ) -> None:
        raise NotImplementedError  # who listens sends nothing

    @property
    def dropped(self) -> int:
        return 0 if self._link is None else self._link.dropped

    @property
    def descriptor(self) -> int | None:
        return None if self._link is None else self._link.descriptor

    def close(self) -> None:
        if self._link is not None:
            self._link.close()


def used_buses(bench: Bench) -> frozenset[int]:
    """Numbers of the buses that any injector reads from or sends to."""
    return frozenset[int]().union(*(buses_of(map_bus(alone)) for alone in bench.each))


class LogSource(FrameSource):
    """A CAN log, from its first frame on, at the pace of its stamps."""

    def __init__(
        self,
        path: Path,
        links: Sequence[NamedLink],
        from_channels: Sequence[str] = (),
        speed: float = 1.0,
        part: tuple[float, float] = (0.0, math.inf),
    ) -> None:
        """from_channels: texts of `--from-channel`; part: from when to when [s] of the log.

        Raises `UserError` for a log that is none, or malformed.
        """
        with file_errors(path), path.open("rb"):
            pass
        self._speed, self._part = speed, part
        channels = chosen_channels(path, links, set(range(len(links))), from_channels)
        self._bus_of = {channel: bus for bus, channel in channels.items()}
        self._log = open_log(path)
        self._path = path

    def run(self, take: Taker, stop: threading.Event) -> None:
        """Give all frames. Raises `UserError` where the log is malformed, or has none."""
        first: int | None = None
        begin = time.monotonic_ns()
        for entry in self._log:
            if stop.is_set():
                return
            bus = self._bus_of.get(entry.channel, self._bus_of.get(None))
            if bus is None:
                continue
            stamp = entry.frame.stamp_ns
            first = stamp if first is None else first
            at, (start, end) = (stamp - first) / SECOND, self._part
            if at < start:
                continue
            if at > end:
                return
            early = SECOND * (at - start) / self._speed - (time.monotonic_ns() - begin)
            if early > 0 and stop.wait(early * 1e-9):
                return
            take(BusFrame(bus, entry.frame), stamp)
        if first is None:
            raise UserError(str(self._path), "holds no data frame", "record it while frames are on the bus")


@dataclass(frozen=True)
class BusSeen:
    """A bus: its name, the share of the time it is busy, and why it is down, if it is."""

    label: str
    load: float
    down: str = ""


class Watching:
    """Listens beside; what it knows may be asked for by any thread."""

    def __init__(self, bench: Bench, source: FrameSource) -> None:
        self.source = source
        self.failure: Exception | None = None
        """Error that ended listening, if one did."""
        used, links = used_buses(bench), bench.config.buses
        self._labels = {bus: link.label for bus, link in enumerate(links) if bus in used}
        self._loads = [BusLoadMeter(link.config) for link in links]
        self._injectors = [WatchedInjector(alone) for alone in bench.each]
        self._buses_of = [sorted(buses_of(injector.bus)) for injector in self._injectors]
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._now = 0  # of the last frame
        self._thread = threading.Thread(target=self._run, name="listening", daemon=True)

    @property
    def now(self) -> int:
        """The time, of a log that of its last frame [ns since 1970]."""
        return time.time_ns() if self.source.is_live else self._now

    @property
    def is_over(self) -> bool:
        """Whether nothing is listened to any more: a log has ended, or listening failed."""
        return self._thread.ident is not None and not self._thread.is_alive()

    def start(self) -> None:
        """Begin to listen."""
        if self.source.is_live:
            self._begin(time.time_ns())
        self._thread.start()

    def close(self) -> None:
        """Listen no longer."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def buses(self) -> tuple[BusSeen, ...]:
        """Every bus that is used as it is now."""
        with self._lock:
            now, down = self.now, self.source.down
            return tuple(
                BusSeen(label, self._loads[bus].share(now), down.get(bus, ""))
                for bus, label in self._labels.items()
            )

    def injectors(self) -> tuple[Seen, ...]:
        """Every injector as it is now."""
        with self._lock:
            now = self.now
            return tuple(
                self._with_full_buses(injector.seen(now), buses, now)
                for injector, buses in zip(self._injectors, self._buses_of, strict=True)
            )

    def use_models(self, bench: Bench) -> None:
        """Compare injections with the models that the bench file names now."""
        with self._lock:
            for injector, alone in zip(self._injectors, bench.each, strict=True):
                injector.use_model(alone.injector)

    def _with_full_buses(self, seen: Seen, buses: Sequence[int], now: int) -> Seen:
        full = [self._loads[bus].fault(self._labels[bus], now) for bus in buses]
        return replace(seen, faults=(*seen.faults, *filter(None, full)))

    def _begin(self, now: int) -> None:
        for injector in self._injectors:
            injector.begin(now)

    def _run(self) -> None:
        try:
            self.source.run(self._take, self._stop)
        except Exception as error:  # the page says it; nothing else could
            self.failure = error

    def _take(self, came: BusFrame, now: int) -> None:
        with self._lock:
            if not self._now and not self.source.is_live:
                self._begin(now)
            self._now = now
            self._loads[came.bus].note(came.frame, now)
            key = frame_key(came.frame.frame_id, came.frame.is_extended, came.bus)
            for injector in self._injectors:
                if key in injector.keys:
                    injector.take(came, now)


class BusLoadMeter:
    """The share of the last second that frames took on a bus, at the bit rates the bench file states."""

    def __init__(self, link: LinkConfig) -> None:
        self._frame_time = cache(
            lambda length, is_fd, is_extended: frame_time(
                length, is_fd, link.bit_rate, link.data_bit_rate, is_extended
            )
        )
        self._parts: deque[tuple[int, float]] = deque()  # of a tenth of a second each: begin [ns], busy [s]
        self._full_since: int | None = None

    def note(self, frame: Frame, now: int) -> None:
        """A frame came at a time [ns]."""
        busy = self._frame_time(len(frame.payload), frame.is_fd, frame.is_extended)
        if not self._parts or now - self._parts[-1][0] >= OVER // 10:
            self._parts.append((now, 0.0))
        begin, sum_before = self._parts[-1]
        self._parts[-1] = begin, sum_before + busy

    def share(self, now: int) -> float:
        """0 to 1, and beyond what the bus could carry."""
        while self._parts and now - self._parts[0][0] > OVER:
            self._parts.popleft()
        return sum(busy for _, busy in self._parts) * 1e9 / OVER

    def fault(self, label: str, now: int) -> Fault | None:
        """Where frames want more than the bus carries: a real one loses some. None: they do not."""
        share = self.share(now)
        if share <= FULL:
            self._full_since = None
            return None
        if self._full_since is None:
            self._full_since = now
        return Fault(f"{label} is full: {100 * share:.0f} % load", self._full_since, _FULL_REMEDY)
