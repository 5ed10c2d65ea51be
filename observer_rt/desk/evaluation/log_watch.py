"""The daemon's watches of inputs over a log, their findings in words."""

from pathlib import Path

from observer_rt.bus.can_frame import frame_key
from observer_rt.bus.links.link import Frame
from observer_rt.bus.mapping.bus_map import BusMap, layout_of, stream_of
from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import Role
from observer_rt.daemon.arrivals import STALE
from observer_rt.daemon.input_watch import PERIOD, InputWatch
from observer_rt.daemon.signal_watch import OUTSIDE_REMEDY
from observer_rt.engine.service.core import Core
from observer_rt.foundation.units import NANOSECONDS, first_of

MOST_NOTES = 20
SHORTEST_PAUSE = 0.1  # s in the stamps: no frame waits so long


class LogWatch:
    """Is given every frame of a log after the core; the first stamp is the begin.

    spans: first and last stamp [ns] by the key of a message; of that with the line pressure, whose samples are the
    grid, when its stamps step ahead and by how much [s], and its duration [s] since there are samples.
    """

    def __init__(self, injector: BenchInjector, bus_map: BusMap, core: Core) -> None:
        self.core, self._watch = core, InputWatch(injector, bus_map, core)
        self.leading = layout_of(bus_map, stream_of(bus_map, Role.LINE_PRESSURE)).key
        self.spans: dict[int, tuple[int, int]] = {}
        self.pauses: list[tuple[float, float]] = []
        self._has_begun, self.duration = False, 0.0
        self._first: int | None = None
        self._next = 0
        self._now = 0
        self._notes: list[str] = []

    def is_due(self, stamp: int) -> bool:
        """Whether a look at the core is due with the frame of a stamp [ns]."""
        return self._first is None or stamp >= self._next

    def note(self, bus: int, frame: Frame) -> None:
        """Takes a frame of the log."""
        if self._first is None:
            self._first = self._next = frame.stamp_ns
            self._watch.arrivals.begin(frame.stamp_ns)
        self._now = frame.stamp_ns
        self._watch.arrivals.note(bus, frame.frame_id, frame.is_extended, self._now)
        key = frame_key(frame.frame_id, frame.is_extended, bus)
        first, last = self.spans.get(key, (self._now, self._now))
        self.spans[key] = (first, self._now)
        if key == self.leading:
            step = (self._now - last) / NANOSECONDS
            if step > SHORTEST_PAUSE:
                self.pauses.append(((last - first) / NANOSECONDS, step))
            self.duration += step if self._has_begun else 0.0
            self._has_begun |= self.core.processed > 0  # before that, it may still learn the clocks
        if self.is_due(self._now):
            self._next = self._now + PERIOD
            at = (self._now - self._first) / NANOSECONDS
            texts = (notice.text for notice in self._watch.look(self._now))
            self._notes += [f"at {at:.1f} s: {text}" for text in texts if OUTSIDE_REMEDY not in text]

    def paused(self) -> str:
        """The pauses in words."""
        return first_of([f"after {begin:.4g} s its stamps step ahead by {step:.6g} s" for begin, step in self.pauses])

    def outside(self) -> str:
        """Signals with values that are missing because they lie outside the declared range, in words."""
        return "; ".join(self._watch.ranges.described(self.core.parts["receiver"]).values())

    def absent(self) -> list[str]:
        """Messages that samples need and that never came."""
        arrivals = self._watch.arrivals
        return [
            f"{source.text}: no frame in the log"
            for source in arrivals.sources
            if source.streams and not arrivals.count_of(source).frames
        ]

    def notes(self, path: Path) -> list[str]:
        """Findings in words, the end of the log included."""
        arrivals = self._watch.arrivals
        ended = [
            f"{source.text}: no frame in the last {arrivals.age(source, self._now):.1f} s"
            for source in arrivals.sources
            if source.streams and arrivals.age(source, self._now) > STALE
        ]
        findings = [*self._notes, *ended]
        left = len(findings) - MOST_NOTES
        more = [f"{left} more of the kind are left out"] if left > 0 else []
        return [f"{path}: {text}" for text in (*findings[:MOST_NOTES], *more)]
