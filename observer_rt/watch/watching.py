"""All injectors of a bench, listened to by a thread of its own."""

import threading
import time
from collections import deque
from dataclasses import dataclass
from functools import cache

from observer_rt.bus.can_frame import ParameterGroups, frame_key
from observer_rt.bus.links.link import BusFrame, Frame
from observer_rt.bus.mapping.output_messages import frame_time
from observer_rt.config.bench import Bench
from observer_rt.config.links import LinkConfig
from observer_rt.watch.injector import Seen, WatchedInjector
from observer_rt.watch.listening import FrameSource, used_buses

OVER = 1_000_000_000  # ns


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
        """Why it hears nothing any more."""
        used, links = used_buses(bench), bench.config.buses
        self._labels = {bus: link.label for bus, link in enumerate(links) if bus in used}
        self._loads = [BusLoadMeter(link.config) for link in links]
        self._injectors = [WatchedInjector(alone) for alone in bench.each]
        received = [layout for each in self._injectors for layout in each.bus.received]
        self._groups = [
            ParameterGroups(each.received_id for each in received if each.bus == bus)
            for bus in range(len(links))
        ]
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._now = 0  # of the last frame
        self._thread = threading.Thread(target=self._run, name="listening", daemon=True)

    @property
    def now(self) -> int:
        """The time, of a log that of its last frame [ns since 1970]."""
        return time.time_ns() if self.source.is_live else self._now

    def start(self) -> None:
        """Begin to listen."""
        for injector in self._injectors:
            injector.prepare()
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
            return tuple(injector.seen(now) for injector in self._injectors)

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
            came = self._own(came)
            key = frame_key(came.frame.frame_id, came.frame.is_extended, came.bus)
            for injector in self._injectors:
                if key in injector.keys:
                    injector.take(came, now)

    def _own(self, came: BusFrame) -> BusFrame:
        """Under the identifier of the bench: a message of J1939 may come from another source address."""
        identifier = came.frame.frame_id
        if not came.frame.is_extended or (own := self._groups[came.bus].own(identifier)) == identifier:
            return came
        return BusFrame(came.bus, came.frame._replace(frame_id=own))


class BusLoadMeter:
    """The share of the last second that frames took on a bus, at the bit rates the bench file states."""

    def __init__(self, link: LinkConfig) -> None:
        self._frame_time = cache(
            lambda length, is_fd, is_extended: frame_time(
                length, is_fd, link.bit_rate, link.data_bit_rate, is_extended
            )
        )
        self._parts: deque[tuple[int, float]] = deque()  # of a tenth of a second each: begin [ns], busy [s]

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
