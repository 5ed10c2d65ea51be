"""Where frames come from: the buses of a bench, or a log of them at its own pace."""

import math
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from observer_rt.bus.links.link import BusFrame, Link, LinkDownError
from observer_rt.bus.links.opening import open_link
from observer_rt.bus.links.outage import EnduringReading
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench
from observer_rt.config.links import NamedLink
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.recording.channels import chosen_channels
from observer_rt.recording.formats import open_log
from observer_rt.service.opening import RETRY, buses_of
from observer_rt.service.watch.arrivals import SECOND

Taker = Callable[[BusFrame, int], None]
"""Takes a frame that came at a time [ns since 1970]."""
_WAIT = 0.05  # s that the listener is deaf to its end


class FrameSource(ABC):
    """Gives frames until told to stop."""

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
        self._awaited: Mapping[int, str] = {}

    @property
    def dropped(self) -> int:
        """Frames that the kernel or an interface lost."""
        return 0 if self._reading is None else self._reading.dropped

    @property
    def down(self) -> Mapping[int, str]:
        """Buses that are down, with why."""
        if self._reading is None:
            return self._awaited
        return {self._buses[place]: why for place, why in self._reading.down.items()}

    def run(self, take: Taker, stop: threading.Event) -> None:
        """Listen until told to stop. Raises `RunError` when a link cannot be opened, or fails for good."""
        with ExitStack() as stack:
            links: list[Link] = []
            for bus in self._buses:
                link = self._opened(bus, stop)
                if link is None:
                    return
                links.append(stack.enter_context(link))
            self._reading = EnduringReading(links)
            stack.callback(self._reading.close)
            while not stop.is_set():
                came = self._reading.receive(_WAIT)
                if came is not None:
                    take(BusFrame(self._buses[came.bus], came.frame), time.time_ns())

    def _opened(self, bus: int, stop: threading.Event) -> Link | None:
        """The link of a bus, once its interface is there; None: told to stop."""
        config = self._links[bus].config
        while not stop.is_set():
            try:
                return open_link(config.interface, config.channel, config.fd, computer_time=True)
            except LinkDownError as error:
                self._awaited = {bus: str(error)}
                stop.wait(RETRY)
        return None


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
