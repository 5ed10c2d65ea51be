"""Runs the observer and the model as given, with nothing learned, over the same samples of many recordings.

What comes next is read ahead in a thread.
"""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.alignment import Break
from observer_rt.bus.links.link import BusFrame, FrameBlock, blocks_of
from observer_rt.bus.mapping.bus_map import BusMap, map_bus
from observer_rt.config.bench import Bench
from observer_rt.core.stream.stream import RING
from observer_rt.desk.evaluation.segment import Segment, Signal
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.observer import commands_at, energize, remembered
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.reports.news import MeasuredMass, News
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.injector import Follower, LearnerFactory, make_learner
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.engine.stream.state import Constants, Observer
from observer_rt.files.replay.recording_frames import Device
from observer_rt.files.signals.recording import Chunk
from observer_rt.files.signals.stream import SignalStream
from observer_rt.model.effective import Clock

if TYPE_CHECKING:
    from observer_rt.desk.evaluation.evaluate import Evaluation

Thing = TypeVar("Thing")
Progress = Callable[[int], None]  # samples done


def prefetch(iterable: Iterable[Thing]) -> Iterator[Thing]:
    """Yields things, none of them None, in their order; while one is used the next is made in a thread beside.

    Raises what making one raises, when its turn has come.
    """
    waiting = iter(iterable)
    with ThreadPoolExecutor(1, "ahead") as executor:
        coming = executor.submit(next, waiting, None)
        while (thing := coming.result()) is not None:
            coming = executor.submit(next, waiting, None)
            yield thing


class NominalModel:
    """Follows an observer's samples with nothing learned, from every state on in which that found the line."""

    def __init__(self, constants: Constants) -> None:
        self._follower = Follower(constants)
        self._end = self._injections = 0

    def rates(self, observer: Observer, first: int, end: int) -> Signal:
        """Rates [m3/s] at positions [first, end), processed and remembered; nan where the observer has none."""
        if first != self._end:
            self._follower.begin(np.full(observer.constants.coefficients.states, np.nan))
        self._follower.constants, self._end = observer.constants, end  # of fuel as warm as it is
        before = max(first - 1, 0)
        rows = remembered(observer.ring, before, end)
        rates, is_open = np.zeros(len(rows)), rows["seat_area"] > 0.0
        openings = self._injections + np.cumsum(np.diff(is_open, prepend=is_open[:1]) & is_open)
        runs = ~(rows["resting"] | (rows["broken"] != Break.NONE))  # elsewhere x^ is x~
        for start, stop in np.flatnonzero(np.diff(runs, prepend=False, append=False)).reshape(-1, 2).tolist():
            from_row = max(start - 1, 0)
            if start > 0:
                position = before + from_row
                clock = Clock(position * observer.constants.interval, float(openings[from_row]))
                self._follower.begin(observer.x_tilde[position % RING], clock)
            commands = commands_at(observer, before + from_row, before + stop)
            rates[from_row:stop] = self._follower.along(rows[from_row:stop], commands)
        self._injections = int(openings[-1])
        return np.where(np.isnan(rows["injection_rate"]), np.nan, rates)[first - before :]


class _Reading:
    """Samples of a core read so far, and the segment in which the last one lies."""

    def __init__(self, core: Core) -> None:
        self.core = core
        self._seen = 0
        self.segment = 0
        """Number of that of the last sample read."""
        self._last_index = -1

    def parts(self, segments: list[Segment]) -> Iterator[tuple[Segment, int, NDArray[np.int64]]]:
        """Yields samples processed since the last reading, by segment: position of the first, and all indices."""
        processed = self.core.processed
        position = max(self._seen, processed - RING)
        ring = self.core.compiled.observer.ring["index"]
        index = ring[np.arange(position, processed) % len(ring)]
        self._seen = processed
        begins_anew = np.flatnonzero(np.diff(index, prepend=self._last_index) <= 0).tolist()
        for first, end in pairwise([0, *(row for row in begins_anew if row), len(index)]):
            if first in begins_anew:
                self.segment += 1
            yield from self._by_segment(segments, position + first, index[first:end])
        self._last_index = int(index[-1]) if len(index) else self._last_index

    def _by_segment(
        self, segments: list[Segment], position: int, index: NDArray[np.int64]
    ) -> Iterator[tuple[Segment, int, NDArray[np.int64]]]:
        """Splits the samples of a rising index by segment."""
        while len(index):
            self.segment = min(self.segment, len(segments) - 1)
            after = segments[self.segment + 1 :][:1]
            end = np.searchsorted(index, after[0].first_index) if after else len(index)
            here = segments[self.segment]
            if after and after[0].first_index < here.first_index + here.samples:  # begins anew, not yet
                end = len(index)
            if end:
                yield here, position, index[:end]
            if end < len(index):
                self.segment += 1
            index, position = index[end:], position + int(end)


class ObserverRun:
    """One observer, learning in lockstep, whose results go to the segments of the recordings it is given."""

    def __init__(
        self,
        bench: Bench,
        knowledge: Knowledge | None = None,
        learning: bool = True,
        progress: Progress | None = None,
        learner_of: LearnerFactory = make_learner,
        fuel_temperature: float | None = None,
        keeps_frames: bool = False,
        reads_ahead: bool = True,
        commanded: bool | None = None,
    ) -> None:
        """keeps_frames: that were sent; reads_ahead: recordings, in a thread beside; commanded: as of `Core`."""
        self.frames: list[OutputFrame] = []
        """Frames that were sent, with `keeps_frames`."""
        self._news: list[News] = []
        bus: BusMap = map_bus(bench)
        if not keeps_frames:
            bus = replace(bus, rate=None)
        self.core = Core(
            bench.injector,
            bus,
            knowledge,
            learning=learning,
            listeners=[self._news.append],
            learner_of=learner_of,
            fuel_temperature=fuel_temperature,
            writes_summaries=keeps_frames,
            commanded=commanded,
        )
        self._commands, self._is_energized = 0, False
        self._reading = _Reading(self.core)
        self._nominal = NominalModel(self.core.compiled.observer.constants)
        self._device = Device(bus)
        self._progress = progress or (lambda _: None)
        self._keeps_frames = keeps_frames
        self._reads_ahead = reads_ahead
        self._segments: list[Segment] = []
        self._finished = 0  # segments

    def take(self, stream: SignalStream, sink: "Evaluation") -> list[Segment]:
        """Observe a recording as the frames of a measuring device; between stretches the sample index jumps."""
        rate, before = stream.sample_rate, len(self._segments)
        framed = self._framed(stream)
        for chunk, begun, blocks in prefetch(framed) if self._reads_ahead else framed:
            if begun is not None:
                self._segments.append(Segment(sink, begun, 0, rate))
            self._segments[-1].give(chunk.time, chunk.injection_rate)
            if chunk.energizing is not None:
                self._energize(self._segments[-1].first_index + chunk.first, chunk.energizing > 0.5)
            self._observe(blocks)
        return self._segments[before:]

    def _framed(self, stream: SignalStream) -> Iterator[tuple[Chunk, int | None, list[FrameBlock]]]:
        """Chunks and their frames, with the sample index of those that begin a stretch."""
        for chunk in self._device.chunks(stream.chunks()):
            begun = self._device.begin(stream.sample_rate) if chunk.first == 0 else None
            yield chunk, begun, list(self._device.blocks(chunk))

    def _energize(self, first_index: int, level: NDArray[np.bool_]) -> None:
        """Tell the observer the commands in samples (n,) of a level, which no frame carries."""
        observer = self.core.compiled.observer
        for row in np.flatnonzero(np.diff(level, prepend=self._is_energized)).tolist():
            if level[row]:
                self._commands, self._begun = self._commands + 1, first_index + row
                energize(observer, self._commands - 1, self._begun)
            else:
                energize(observer, self._commands - 1, self._begun, first_index + row - self._begun)
        self._is_energized = bool(level[-1])

    def take_frames(self, frames: Iterable[BusFrame], segments: Iterable[Segment]) -> None:
        """Observe frames as they are, which carry the samples of segments in their order."""
        self._segments += segments
        self._observe(blocks_of(frames))

    def finish(self) -> None:
        """Judge every event: no recording will come."""
        self._sent(self.core.finish())
        self._read()
        for segment in self._segments[self._finished :]:
            segment.finish()

    def _observe(self, blocks: Iterable[FrameBlock]) -> None:
        for block in blocks:
            self._sent(self.core.handle_many(block))
            self._read()
            self._forget()

    def _sent(self, frames: list[OutputFrame]) -> None:
        if self._keeps_frames:
            self.frames += frames

    def _read(self) -> None:
        """Note the samples processed since the last call, then the results of injections."""
        observer = self.core.compiled.observer
        for segment, position, index in self._reading.parts(self._segments):
            nominal = self._nominal.rates(observer, position, position + len(index))
            segment.note(observer, position, index, nominal)
        for news in self._news:
            match news:
                case InjectionReport():
                    self._segment_of(news).note_report(news)
                case MeasuredMass(report):
                    self._segment_of(report).sink.take_measured(news)
        self._news.clear()
        self._progress(self.core.processed)

    def _segment_of(self, report: InjectionReport) -> Segment:
        begun = [segment for segment in self._segments if segment.begin is not None]
        return next(
            (one for one in reversed(begun) if one.begin is not None and one.begin <= report.start_position),
            begun[0],
        )

    def _forget(self) -> None:
        """Hand over, in order, samples that no injection will need."""
        processed = self.core.processed
        for number in range(self._finished, self._reading.segment + 1):
            segment = self._segments[number]
            if number == self._reading.segment or segment.end > processed - RING:
                segment.pass_on(processed)
                return
            segment.finish()
            self._finished = number + 1
