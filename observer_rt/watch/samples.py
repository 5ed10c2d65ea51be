"""The samples that an observer is given, and the rates that it publishes, by their sample index."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.database.frame_key import frame_key
from observer_rt.bus.links.link import BusFrame
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.timing import Numbering
from observer_rt.config.bench import BenchInjector
from observer_rt.observer.stream.state import RING
from observer_rt.service.core.core import Core
from observer_rt.watch.results import Rates

_INDEX = 0xFFFFFFFF  # bits of a sample index as it is sent


class InputSamples:
    """The last samples of one injector, checked, decoded and joined as the daemon does it, but not observed."""

    def __init__(self, fitted: BenchInjector, bus: BusMap) -> None:
        self._compiled = Core(fitted, bus, learning=False).compiled
        self._keys = set(bus.inputs.messages["key"][: len(bus.input_layouts)].tolist())

    def prepare(self) -> None:
        """Compile, or load, what frames will need: an empty one is passed over."""
        self._compiled.listen(min(self._keys), np.empty(0, np.uint8), 0)

    def take(self, came: BusFrame) -> bool:
        """A frame; one that brings no samples is passed over: False."""
        key = frame_key(came.frame.frame_id, came.frame.is_extended, came.bus)
        if key not in self._keys:
            return False
        self._compiled.listen(key, np.frombuffer(came.frame.payload, np.uint8), came.frame.stamp_ns)
        return True

    @property
    def received(self) -> int:
        """Samples so far."""
        return int(self._compiled.observer.memory["received"][0])

    @property
    def newest(self) -> int:
        """Index of the last one."""
        return int(self._compiled.observer.ring["index"][(self.received - 1) % RING])

    @property
    def lookahead(self) -> int:
        """Samples that an observer must know beyond one."""
        return int(self._compiled.observer.constants.timing.lookahead)

    @property
    def are_counted(self) -> bool:
        """Whether their index is not sent, but counted since the first one came."""
        keeping = self._compiled.pipeline.keeping
        return bool(keeping.timing[keeping.memory[0]["leading"]]["numbering"] != Numbering.INDEX)

    def between(self, start: int, end: int) -> NDArray[np.void]:
        """Those with an index as sent in [start, end], dtype `sample_dtype`; only the newest are remembered."""
        received, ring = self.received, self._compiled.observer.ring
        index = ring["index"] & _INDEX
        place = np.flatnonzero((index >= start) & (index <= end))
        if received < RING:
            place = place[place < received]
        age = (received - 1 - place) % RING
        return ring[place[np.argsort(age)[::-1]]]


class PublishedRates:
    """The last published rates [mm3/ms]."""

    def __init__(self) -> None:
        self._index = np.full(RING, -1, np.int64)
        self._rate = np.full(RING, np.nan)

    def take(self, rates: Rates) -> None:
        """A frame's."""
        index = (rates.index + np.arange(rates.rates.size)) & _INDEX
        self._index[index % RING] = index
        self._rate[index % RING] = rates.rates

    def at(self, index: NDArray[np.int64]) -> NDArray[np.float64]:
        """At sample indices (n,); nan: not published, or long ago."""
        sent = index & _INDEX
        place = sent % RING
        return np.where(self._index[place] == sent, self._rate[place], np.nan)
