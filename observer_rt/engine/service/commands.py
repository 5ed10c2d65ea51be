"""Reads the injector's commands from levels or durations, and finds their openings, delays and missing injections."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from operator import itemgetter

import numpy as np

from observer_rt.bus.mapping.optional_inputs import EnergizingLayout, EnergizingSignal
from observer_rt.core.stream.stream import INJECTIONS, RING
from observer_rt.engine.observer import energize, samples_between, was_shut
from observer_rt.engine.reports.injection_report import CommandedOpening
from observer_rt.engine.reports.news import MissingInjection
from observer_rt.engine.service.messages import CompiledPipeline
from observer_rt.foundation.units import MICROSECOND, MILLISECOND, NANOSECONDS, Floats

OVERTAKEN = 10 * MILLISECOND  # by which a frame may be older than the one before; more is a new count
MOST_COMMANDS = 64  # remembered; the oldest is forgotten
RECENT = 100  # delays that mean and spread are of
LATE_STAMP = 1 * MILLISECOND  # by which stamps may be beside their clock, and a command after its opening


@dataclass(eq=False)
class Command:
    """One energizing of the injector; moments are sample indices, or ns by the clock of the stamps."""

    start: int
    duration: float = math.nan  # s; nan: not known yet
    number: int = 0  # from 1
    came: int = 0  # samples processed when it did
    was_shut: bool | None = None  # the needle as it started; None: not known yet
    has_opened: bool = False


class CommandReader:
    """Finds the commands in the frames; `by_index`: moments are sample indices."""

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
        self.under_way: Command | None = None
        """The command whose end is still to come."""
        self._last: int | None = None  # moment at which something was known last

    def read(self, reading: EnergizingSignal) -> list[Command]:
        """Commands that start in a frame."""
        first = reading.taken - round((self._samples - 1) * self._units) if reading.first is None else reading.first
        since = math.inf if self._last is None else self._distance(self._last, first)
        if self.by_index and -OVERTAKEN * self._sample_rate < since <= 0:
            return []  # repeated, or overtaken
        if self._last is None or since < 0:  # the first one, or all begins anew
            self._last = None
            self._lose()
        elif since > self._longest or (reading.follows is False and not (self.by_index and self._longest < math.inf)):
            self._lose()  # frames were lost before this one
        if not self._is_level:
            self._last, duration = first, float(reading.values[0])
            return [Command(first, duration)] if 0.0 < duration < math.inf else []
        steady = self._level is not None and bool(((reading.values != 0.0) == self._level).all())
        if steady and not math.isnan(reading.values.sum()):
            self._last = first + round((self._samples - 1) * self._units)
            return []
        levels = enumerate(reading.values.tolist())
        starts = (self._read_level(first + round(number * self._units), value) for number, value in levels)
        return [command for command in starts if command is not None]

    def _distance(self, earlier: int, later: int) -> float:
        return samples_between(earlier, later) if self.by_index else (later - earlier) / self._units

    def _lose(self) -> None:
        """Forget level and command under way, for commands may have come unseen."""
        self._level = None
        self.under_way = None

    def _read_level(self, moment: int, value: float) -> Command | None:
        """Takes one sample; returns a command where energizing starts with it."""
        if math.isnan(value):
            self._lose()
            return None
        was, self._level, self._last = self._level, value != 0.0, moment
        if self._level == was:
            return None
        if not self._level:
            if self.under_way is not None:
                self.under_way.duration = self._distance(self.under_way.start, moment) / self._sample_rate
            return None
        if was is None and self._cycle is not None:
            return None  # it may have been so for long: frames before were lost
        self.under_way = Command(moment)
        return self.under_way


@dataclass(frozen=True)
class EnergizingFigures:
    """Counts so far; mean and standard deviation of the last opening delays [s], nan: none yet."""

    commands: int
    missing: int
    mean_delay: float
    delay_sigma: float

    def as_text(self) -> str:
        """Describes the figures on one line."""
        delay = "not known yet"
        if not math.isnan(self.mean_delay):
            delay = f"{self.mean_delay / MICROSECOND:.0f} ± {self.delay_sigma / MICROSECOND:.0f} us"
        return f"{self.commands} commands, {self.missing} injections missing, opening delay {delay}"


class EnergizingWatch:
    """Joins commands and openings, whichever comes first.

    An opening, once reported, belongs to the last command before it, if recent and unopened. A command misses its
    injection when it started on a shut needle, lost no sample since, and has no opening without a command in its
    window.
    """

    def __init__(
        self, energizing: EnergizingLayout, compiled: CompiledPipeline, on_missing: Callable[[MissingInjection], None]
    ) -> None:
        sample_rate = 1.0 / compiled.observer.constants.interval
        self._energizing = energizing
        self._reader = CommandReader(energizing, sample_rate)
        self._sample_rate = sample_rate
        self._window = energizing.window * sample_rate  # samples
        self._late = 0.0 if self._reader.by_index else LATE_STAMP * sample_rate
        self._compiled = compiled
        self._on_missing = on_missing
        self._waiting: deque[Command] = deque(maxlen=MOST_COMMANDS)
        self._energized: Command | None = None  # of which the pilot valve knows no end
        # indices of openings without a command, and samples processed when they were reported
        self._unasked: deque[tuple[int, int]] = deque(maxlen=MOST_COMMANDS)
        self._delays: deque[float] = deque(maxlen=RECENT)
        self._newest = 0  # index of the last processed sample
        self._commands = self._missing = 0

    def take(self, values: Floats, stamp: int, follows: bool, processed: int) -> None:
        """Take what a frame says, as of `EnergizingLayout.reading`; processed: samples when it came."""
        for command in self._reader.read(self._energizing.reading(values, stamp, follows)):
            self._tell_valve()
            self._commands += 1
            command.number, command.came, self._energized = self._commands, processed, command
            self._waiting.append(command)
        self._tell_valve()

    def _tell_valve(self) -> None:
        """Tells the pilot valve of the last command, as long as that has no end; else it stays shut."""
        command = self._energized
        if command is None or not self._energizing.tells_samples:
            return
        length = math.inf if command is self._reader.under_way else 0.0
        if not math.isnan(command.duration):
            length = command.duration * self._sample_rate
        energize(self._compiled.observer, command.number - 1, command.start, length)
        if length < math.inf:
            self._energized = None

    @property
    def looks_at_each(self) -> bool:
        """Whether `look` is to be called after every frame, so that what it reports depends on none but these."""
        return bool(self._waiting) or not self._reader.by_index

    def opening_of(self, injection: np.void) -> CommandedOpening | None:
        """The command of an injection (`stream.state.INJECTION`) that is about to be reported; None: not known."""
        opening, is_seen = int(injection["opening_index"]), bool(injection["opening_seen"])
        command = self._command_of(opening)
        if command is None:
            if is_seen:
                self._unasked.append((opening, self._processed))
            return None
        command.has_opened = True
        delay = math.nan
        if is_seen:
            delay = samples_between(self._position(command.start), opening) / self._sample_rate
            self._delays.append(delay)
        return CommandedOpening(command.number, delay, command.duration)

    def look(self) -> None:
        """Reports commands that have had their time without an opening, after samples were processed."""
        # stamps may leave their clock, such as after it was set: then nobody knows when commands came
        if self._processed > 0 and not (self._reader.by_index or self._compiled.is_grid_prompt(LATE_STAMP)):
            self._waiting.clear()
        if not self._waiting or self._processed == 0:
            return
        before = self._newest
        self._newest = int(self._compiled.observer.ring[(self._processed - 1) % RING]["index"])
        if self._newest < before and self._reader.by_index:
            self._forget(before)
        injections, counts = self._compiled.observer.injections, self._compiled.observer.memory[0]["counts"]
        undecided = range(int(counts["injections_reported"]), int(counts["injections_begun"]))  # not reported yet
        openings = [int(injections[number % INJECTIONS]["opening_index"]) for number in undecided]
        for command in [*self._waiting]:
            end = self._position(command.start) + self._window
            if not (samples_between(end, self._newest) > 0 and self._processed - command.came > self._window):
                continue
            if command.was_shut is None:
                begin = samples_between(self._newest, self._position(command.start)) + self._newest
                command.was_shut = was_shut(self._compiled.observer, begin, begin + self._window)
            if not any(samples_between(opening, end) >= 0 for opening in openings):
                self._waiting.remove(command)
                self._judge(command)

    @property
    def figures(self) -> EnergizingFigures:
        delays = list(self._delays)  # asked for from another thread, too
        mean, sigma = (float(np.mean(delays)), float(np.std(delays))) if delays else (math.nan, math.nan)
        return EnergizingFigures(self._commands, self._missing, mean, sigma)

    @property
    def _processed(self) -> int:
        return int(self._compiled.observer.memory[0]["positions"]["processed"])

    def _position(self, moment: int) -> float:
        """Index of a moment; nan while the clock of the stamps is not known."""
        return float(moment) if self._reader.by_index else self._compiled.place_at(moment)

    def _command_of(self, opening: int) -> Command | None:
        since = [(samples_between(self._position(one.start), opening), one) for one in self._waiting]
        started = [each for each in since if 0.0 <= each[0] <= self._window]
        _, last = min(started, key=itemgetter(0), default=(math.inf, None))
        if last is not None and not last.has_opened:
            return last
        late = [each for each in since if -self._late <= each[0] < 0.0 and not each[1].has_opened]
        return max(late, key=itemgetter(0))[1] if late else None

    def _forget(self, before: int) -> None:
        """Forgets commands from before the count began anew, which have no openings any more."""
        for command in [*self._waiting]:
            now, then = (abs(samples_between(index, command.start)) for index in (self._newest, before))
            if not now < then:
                self._waiting.remove(command)

    def _judge(self, command: Command) -> None:
        """Judges a command whose window is over and whose openings are decided."""
        if command.has_opened or not command.was_shut:
            return
        start = self._position(command.start)
        if any(
            command.came >= reported and 0.0 <= samples_between(start, opening) <= self._window
            for opening, reported in self._unasked
        ):
            return  # the command of an opening that was already reported
        self._missing += 1
        self._on_missing(MissingInjection(command.number, round(start), self._window / self._sample_rate))
