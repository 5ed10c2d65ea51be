"""Commands of an injector: when energizing starts and how long it lasts, from levels or durations as they come."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from observer_rt.bus.mapping.optional_inputs import NANOSECONDS, EnergizingLayout, EnergizingSignal
from observer_rt.bus.mapping.timing import SLOTS
from observer_rt.foundation.units import MILLISECOND

INDICES = 1 << 32  # after which a sample index begins again
REMEMBERED = 8  # spans in which commands may have been lost
OVERTAKEN = 10 * MILLISECOND  # by which a frame may be older than the one before; more is a new count


def samples_between(earlier: float, later: float) -> float:
    """From one sample index to another, either of them modulo 2^32; nan if one is not known."""
    return (later - earlier + INDICES / 2) % INDICES - INDICES / 2


@dataclass(eq=False)
class Command:
    """One energizing of the injector; moments are sample indices, or ns by the clock of the stamps.

    margin [samples]: what the start may lie beside `start`; duration [s], nan while not known. A command that is
    not certain may be the end of one before it: frames between the two were lost.
    """

    start: int
    margin: float
    is_certain: bool = True
    duration: float = math.nan
    number: int = 0  # from 1, once it is certain
    has_opened: bool = False


class CommandReader:
    """Finds the commands in what the frames say; `by_index`: moments are sample indices."""

    def __init__(self, energizing: EnergizingLayout, sample_rate: float) -> None:
        """sample_rate: of the grid [Hz]."""
        self.by_index = energizing.index is not None
        self._is_level = energizing.is_level
        self._samples = len(energizing.names)
        self._units = 1.0 if self.by_index else NANOSECONDS / sample_rate  # from sample to sample
        self._sample_rate = sample_rate
        self._cycle = None if energizing.cycle is None else energizing.cycle * sample_rate  # samples
        # from the last sample of a frame to the first of the next; the index of a duration is that of its start
        self._longest = math.inf
        if self._cycle is not None and (self._is_level or not self.by_index):
            self._longest = 1.5 * self._cycle - (self._samples - 1)
        self._level: bool | None = None
        self._under_way: Command | None = None
        self._last: int | None = None  # moment at which something was known last
        self._lost: deque[tuple[int, int]] = deque(maxlen=REMEMBERED)

    @property
    def lost(self) -> Sequence[tuple[int, int]]:
        """Spans (from, to) in which commands may have come unseen."""
        return self._lost

    @property
    def known_until(self) -> int | None:
        """The moment after which nothing is known of the energizing; None: silence means there is none."""
        if not self._is_level or self._cycle is None or self._last is None:
            return None
        return self._last + round(self._longest * self._units)

    def read(self, reading: EnergizingSignal) -> list[Command]:
        """Commands that start in a frame."""
        if reading.first is not None:
            first = reading.first
        else:
            first = reading.taken - round((self._samples - 1) * self._units)
        since = math.inf if self._last is None else self._distance(self._last, first)
        if self.by_index and -OVERTAKEN * self._sample_rate < since <= 0:
            return []  # repeated, or overtaken
        if self._last is None or since < 0:  # the first one, or all begins anew
            self._last = None
            self._lose(first - round(SLOTS * self._units), first)
        elif self._tells_loss(reading, since):
            self._lose(self._last, first)
        if not self._is_level:
            return self._read_duration(first, float(reading.values[0]))
        steady = self._level is not None and bool(((reading.values != 0.0) == self._level).all())
        if steady and not math.isnan(reading.values.sum()):
            self._last = first + round((self._samples - 1) * self._units)
            return []
        commands = []
        for place, value in enumerate(reading.values.tolist()):
            command = self._read_level(first + round(place * self._units), value)
            if command is not None:
                commands.append(command)
        return commands

    def _tells_loss(self, reading: EnergizingSignal, since: float) -> bool:
        """Whether frames were lost before this one; since [samples]: from the last moment known."""
        if since > self._longest:
            is_pause = reading.follows and self._level is False and reading.values[0] == 0.0
            return not is_pause
        return reading.follows is False and not (self.by_index and self._longest < math.inf)

    def _distance(self, earlier: int, later: int) -> float:
        """Samples."""
        return samples_between(earlier, later) if self.by_index else (later - earlier) / self._units

    def _lose(self, begin: int, end: int) -> None:
        self._level = None
        self._under_way = None
        if self._lost and self._lost[-1][0] == begin:
            self._lost.pop()  # it goes on
        self._lost.append((begin, end))

    def _read_duration(self, moment: int, duration: float) -> list[Command]:
        self._last = moment
        return [Command(moment, 0.0, duration=duration)] if 0.0 < duration < math.inf else []

    def _read_level(self, moment: int, value: float) -> Command | None:
        """One sample; a command where energizing starts with it."""
        if math.isnan(value):
            self._level = None
            self._under_way = None
            return None
        was, before = self._level, self._last
        if was is None and before is not None:
            self._lose(before, moment)
        self._level, self._last = value != 0.0, moment
        if self._level == was:
            return None
        if not self._level:
            if self._under_way is not None:
                end, _ = self._edge(before, moment)
                lasted = self._distance(self._under_way.start, end)
                self._under_way.duration = lasted / self._sample_rate
            return None
        if was is None and self._cycle is not None:
            return Command(moment, 0.0, is_certain=False)
        self._under_way = Command(*self._edge(before, moment))
        return self._under_way

    def _edge(self, before: int | None, moment: int) -> tuple[int, float]:
        """When a level changed that is another at `moment` than before, and by how many samples that may be off.

        Among the samples of a block, and of a message sent on change, at `moment`; between two cyclic frames in the
        middle.
        """
        if before is None or self._samples > 1 or self._cycle is None:
            return moment, 0.0
        distance = self._distance(before, moment)
        return moment - round(distance / 2 * self._units), distance / 2
