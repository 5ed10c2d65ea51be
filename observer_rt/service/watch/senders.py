"""Other nodes that send what only this observer should, while it runs."""

from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.service.watch.arrivals import SECOND, Arrivals, message_text
from observer_rt.service.watch.finding import WatchFinding

REMEDY = "stop the other daemon or replay; two on one bus need messages of their own in [outputs]"
PERIOD = 30.0  # s between two tellings of the same


class SenderWatch:
    """Tells of another sender when it is first heard, and again from time to time while it goes on."""

    def __init__(self, bus: BusMap, arrivals: Arrivals) -> None:
        self._bus = bus
        self._arrivals = arrivals
        self._told = 0  # frames
        self._next = 0
        self._is_contested = False

    def look(self, now: int) -> list[WatchFinding]:
        """News at a time [ns]."""
        frames = self._arrivals.foreign_frames
        if self._is_contested and not self._arrivals.is_contested(now):
            self._is_contested = False
            return [WatchFinding(f"the other sender is silent after {frames} frames", is_over=True)]
        if frames == self._told or now < self._next:
            return []
        self._is_contested = True
        self._told, self._next = frames, now + round(PERIOD * SECOND)
        names = ", ".join(message_text(self._bus, layout) for layout, _ in self._arrivals.foreign)
        return [WatchFinding(f"another node sends {names}: {frames} frames so far\n  remedy: {REMEDY}")]
