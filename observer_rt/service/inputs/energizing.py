"""Commands of the injector and openings of its needle: delays, injections missing, injections without a command."""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.alignment.timekeeping import is_prompt, place_at
from observer_rt.bus.mapping.optional_inputs import EnergizingLayout
from observer_rt.foundation.units import MICROSECOND, MILLISECOND
from observer_rt.observer.observer import was_shut
from observer_rt.observer.stream.state import INJECTIONS, RING
from observer_rt.service.compiled.by_reference import CompiledPipeline
from observer_rt.service.inputs.energizing_commands import Command, CommandReader, samples_between
from observer_rt.service.reports.injection_report import CommandedOpening
from observer_rt.service.reports.news import Mismatch

REMEMBERED = 64  # commands
RECENT = 100  # delays that mean and spread are of
LATE_STAMP = 1 * MILLISECOND  # by which stamps may be beside their clock, and a command after its opening


@dataclass(frozen=True)
class EnergizingFigures:
    """What was counted so far; mean and standard deviation of the last opening delays [s], nan: none yet."""

    commands: int
    missing: int
    uncommanded: int
    mean_delay: float
    delay_sigma: float

    def as_text(self) -> str:
        """One line."""
        delay = "not known yet"
        if not math.isnan(self.mean_delay):
            delay = f"{self.mean_delay / MICROSECOND:.0f} ± {self.delay_sigma / MICROSECOND:.0f} us"
        return (
            f"{self.commands} commands, {self.missing} injections missing, {self.uncommanded} without a command, "
            f"opening delay {delay}"
        )


@dataclass(eq=False)
class _WaitingCommand:
    """A command whose opening is not decided; came: samples processed when it did; was_shut: None while under way."""

    command: Command
    came: int
    was_shut: bool | None = None


class EnergizingWatch:
    """Joins commands and openings, whichever is known first.

    An opening belongs to the last command that started before it, if that was not too long ago and no opening was
    before it; it is decided when its injection is reported. A command is missing its injection when the needle was
    shut as it started, no sample was lost since, and none of the openings in its window is its own. Before the first
    command, and where frames were lost, an opening without one tells nothing.
    """

    def __init__(
        self,
        energizing: EnergizingLayout,
        compiled: CompiledPipeline,
        on_mismatch: Callable[[Mismatch], None],
    ) -> None:
        """on_mismatch: called with every missing injection and every one without a command."""
        sample_rate = 1.0 / compiled.observer.constants.interval
        self._energizing = energizing
        self._reader = CommandReader(energizing, sample_rate)
        self._sample_rate = sample_rate
        self._window = energizing.window * sample_rate  # samples
        self._late = 0.0 if self._reader.by_index else LATE_STAMP * sample_rate
        self._keeping = compiled.pipeline.keeping
        self._compiled = compiled
        self._on_mismatch = on_mismatch
        self._waiting: deque[_WaitingCommand] = deque(maxlen=REMEMBERED)
        # indices of openings without a command, and samples processed when they were reported
        self._unasked: deque[tuple[int, int]] = deque(maxlen=REMEMBERED)
        self._delays: deque[float] = deque(maxlen=RECENT)
        self._doubtful_until: int | None = None  # index up to which stamps did not tell when commands came
        self._newest = 0  # index of the last processed sample
        self._commands = self._missing = self._uncommanded = 0
        place_at(self._keeping, 0)  # compiled before the first command comes

    def take(self, values: NDArray[np.float64], stamp: int, follows: bool, processed: int) -> None:
        """Take what a frame says, as of `EnergizingLayout.reading`; processed: samples when it came."""
        for command in self._reader.read(self._energizing.reading(values, stamp, follows)):
            if command.is_certain:
                self._number(command)
            self._waiting.append(_WaitingCommand(command, processed))

    @property
    def looks_at_each(self) -> bool:
        """Whether `look` is to be called after every frame, so that what it tells depends on none but these."""
        return bool(self._waiting) or not self._reader.by_index

    def opening_of(self, injection: np.void) -> CommandedOpening | None:
        """The command of an injection (`stream.state.INJECTION`) that is about to be reported; None: not known."""
        opening, is_seen = int(injection["opening_index"]), bool(injection["opening_seen"])
        command = self._command_of(opening)
        if command is None:
            if is_seen and self._commands and not self._may_be_lost(opening):
                self._uncommanded += 1
                self._unasked.append((opening, self._processed))
                self._tell(False, int(injection["number"]), opening)
            return None
        command.has_opened = True
        delay = math.nan
        if command.is_certain and is_seen:
            delay = samples_between(self._place(command.start), opening) / self._sample_rate
            self._delays.append(delay)
        else:
            self._number(command)
        return CommandedOpening(command.number, delay, command.duration)

    def look(self) -> None:
        """After samples were processed: which commands have had their time without an opening."""
        if self._processed > 0 and not self._has_time:
            self._doubtful_until = self._newest_index()
            self._waiting.clear()
        if not self._waiting or self._processed == 0:
            return
        before, self._newest = self._newest, self._newest_index()
        if self._newest < before and self._reader.by_index:
            self._forget(before)
        undecided = self._undecided_openings()
        for waiting in [*self._waiting]:
            end = self._place(waiting.command.start) + waiting.command.margin + self._window
            if not (samples_between(end, self._newest) > 0 and self._processed - waiting.came > self._window):
                continue
            if waiting.was_shut is None:
                waiting.was_shut = self._was_shut(waiting.command)
            if not any(samples_between(opening, end) >= 0 for opening in undecided):
                self._waiting.remove(waiting)
                self._judge(waiting)

    @property
    def figures(self) -> EnergizingFigures:
        """What was counted so far."""
        delays = list(self._delays)  # asked for from another thread, too
        mean, sigma = (float(np.mean(delays)), float(np.std(delays))) if delays else (math.nan, math.nan)
        return EnergizingFigures(self._commands, self._missing, self._uncommanded, mean, sigma)

    @property
    def _processed(self) -> int:
        return int(self._compiled.observer.memory["processed"][0])

    def _newest_index(self) -> int:
        return int(self._compiled.observer.ring[(self._processed - 1) % RING]["index"])

    def _number(self, command: Command) -> None:
        if command.number == 0:
            self._commands += 1
            command.number = self._commands

    def _place(self, moment: int) -> float:
        """Index of a moment; nan while the clock of the stamps is not known."""
        return float(moment) if self._reader.by_index else place_at(self._keeping, moment)

    def _command_of(self, opening: int) -> Command | None:
        """The command that an opening belongs to, None if there is none."""
        since = [
            (samples_between(self._place(one.command.start), opening), one.command) for one in self._waiting
        ]
        started = [one for one in since if -one[1].margin <= one[0] <= self._window + one[1].margin]
        elapsed, last = _latest(started, is_certain=True)
        if last is not None and not last.has_opened:
            return last
        elapsed_doubtful, doubtful = _latest(started, is_certain=False)
        if doubtful is not None and not doubtful.has_opened and elapsed_doubtful < elapsed:
            return doubtful
        late = [one for one in since if -self._late <= one[0] + one[1].margin < 0.0]
        late = [one for one in late if one[1].is_certain and not one[1].has_opened]
        return max(late, key=_elapsed)[1] if late else None

    @property
    def _has_time(self) -> bool:
        """Whether it is known when commands came: not so while stamps leave their clock, such as after it was set."""
        return self._reader.by_index or is_prompt(self._keeping, LATE_STAMP)

    def _may_be_lost(self, opening: int) -> bool:
        """Whether the command of an opening may be elsewhere than it seems, in lost frames, or still to come."""
        doubtful = math.nan if self._doubtful_until is None else self._doubtful_until
        if not self._has_time or samples_between(doubtful, opening) <= self._window:
            return True
        until = self._reader.known_until
        if until is not None and not samples_between(opening, self._place(until)) >= 0:
            return True
        return any(
            not samples_between(self._place(begin), opening) < 0
            and not samples_between(self._place(end), opening) > self._window
            for begin, end in self._reader.lost
        )

    def _undecided_openings(self) -> list[int]:
        """Indices of the openings whose injections are not reported yet."""
        memory = self._compiled.observer.memory[0]
        first, end = int(memory["injections_reported"]), int(memory["injections_begun"])
        return [int(memory["injections"][n % INJECTIONS]["opening_index"]) for n in range(first, end)]

    def _forget(self, before: int) -> None:
        """The index began anew after `before`: the commands of the old count have no openings any more."""
        kept = [
            one
            for one in self._waiting
            if abs(samples_between(self._newest, one.command.start))
            < abs(samples_between(before, one.command.start))
        ]
        self._waiting.clear()
        self._waiting.extend(kept)

    def _was_shut(self, command: Command) -> bool:
        """Whether the needle was shut as a command started, and samples tell what it did in its window."""
        begin = samples_between(self._newest, self._place(command.start)) + self._newest - command.margin
        return was_shut(self._compiled.observer, begin, begin + 2 * command.margin + self._window)

    def _judge(self, waiting: _WaitingCommand) -> None:
        """The window of a command is over and its openings are decided."""
        command = waiting.command
        if command.has_opened or not command.is_certain or not waiting.was_shut:
            return
        start = self._place(command.start)
        if any(
            waiting.came >= reported and 0.0 <= samples_between(start, opening) <= self._window
            for opening, reported in self._unasked
        ):
            return  # the command of an opening that was already reported
        self._missing += 1
        self._tell(True, command.number, round(start))

    def _tell(self, is_missing: bool, number: int, index: int) -> None:
        self._on_mismatch(Mismatch(is_missing, number, index, self._window / self._sample_rate))


def _latest(since: Sequence[tuple[float, Command]], is_certain: bool) -> tuple[float, Command | None]:
    """Of the certain or of the doubtful commands the last one, and samples since it; (inf, None): there is none."""
    alike = [one for one in since if one[1].is_certain is is_certain]
    return min(alike, key=_elapsed, default=(math.inf, None))


def _elapsed(since: tuple[float, Command]) -> float:
    """Samples since a command."""
    return since[0]
