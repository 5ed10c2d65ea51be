"""Runs the observer and the model as given, with nothing learned, over the same samples of many recordings."""

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.links.link import FrameBlock, blocks_of
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.core.stream.stream import RING
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.desk.evaluation.logged import LoggedSignals
from observer_rt.desk.evaluation.samples import HistorySamples, Run
from observer_rt.engine.observer import energize
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.reports.news import MeasuredMass, News
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.engine.service.nominal import NominalModel
from observer_rt.files.replay.recording_frames import Device
from observer_rt.files.signals.recording import Chunk
from observer_rt.files.signals.stream import SignalStream, cut
from observer_rt.model.surroundings import Surroundings

PIECE = 5e-3  # s of a recording, in which the surroundings are the same
Progress = Callable[[int], None]  # samples done


class ObserverRun:
    """One observer that learns in lockstep; its results go to the evaluations of the recordings it is given."""

    def __init__(self, core: Core, bus: BusMap, news: list[News], progress: Progress, keeps_frames: bool) -> None:
        """news: to which the core appends; keeps_frames: that were sent."""
        self.frames: list[OutputFrame] = []
        self._core, self._device, self._news = core, Device(bus), news
        self._progress, self._keeps_frames = progress, keeps_frames
        self._nominal = NominalModel(core.compiled.observer.constants)
        self._samples = HistorySamples()
        self._seen = 0  # samples of the core
        self._commands, self._command_start, self._is_energized = 0, 0, False  # start: index of its first sample

    def observe(self, source: SignalStream, sink: Evaluation) -> None:
        """Observe the frames of a log as they are, or a recording in frames of a measuring device.

        Between stretches of a recording the sample index jumps.
        """
        if isinstance(source, LoggedSignals):
            self._observe_log(source, sink)
        else:
            self._observe_recording(source, sink)

    def _observe_log(self, log: LoggedSignals, sink: Evaluation) -> None:
        offset, sink.first_index = 0, log.logged[0].start
        for indices in log.logged:
            self._samples.begin(Run(sink, len(indices), log.sample_rate, indices.start, offset))
            offset += len(indices)
        self._observe(blocks_of(log.frames))

    def _observe_recording(self, stream: SignalStream, sink: Evaluation) -> None:
        rate, start_index = stream.sample_rate, 0  # of the stretch
        for chunk in self._device.chunks(stream.chunks()):
            if chunk.first == 0:
                start_index, samples = self._device.begin(rate), stream.stretches[chunk.stretch].samples
                self._samples.begin(Run(sink, samples, rate, start_index, start=float(chunk.time[0])))
                sink.first_index = start_index if chunk.stretch == 0 else sink.first_index
            self._samples.give(chunk.first, chunk.time, chunk.injection_rate)
            if chunk.energizing is not None:
                self._energize(start_index + chunk.first, chunk.energizing > 0.5)
            self._observe_surrounded(chunk)

    def _observe_surrounded(self, chunk: Chunk) -> None:
        """Observe a chunk; in pieces, with the first values of each, where surroundings are recorded."""
        recorded = {name: values for name, values in chunk.signals.items() if name in Surroundings._fields}
        piece = chunk.samples
        if recorded:
            piece = self._device.block * max(1, round(PIECE * chunk.sample_rate / self._device.block))
        for first in range(0, chunk.samples, piece):
            parts = {name: values[first : first + piece] for name, values in recorded.items()}
            values = {name: float(part[np.isnan(part).argmin()]) for name, part in parts.items()}
            self._core.optional.take(Surroundings(**values))
            self._observe(self._device.blocks(cut(chunk, first, min(first + piece, chunk.samples))))

    def _energize(self, first_index: int, level: NDArray[np.bool_]) -> None:
        """Tell the observer the commands in samples (n,) of a level, which no frame carries."""
        observer = self._core.compiled.observer
        for row in np.flatnonzero(np.diff(level, prepend=self._is_energized)).tolist():
            if level[row]:
                self._commands, self._command_start = self._commands + 1, first_index + row
                energize(observer, self._commands - 1, self._command_start)
            else:
                length = first_index + row - self._command_start
                energize(observer, self._commands - 1, self._command_start, length)
        self._is_energized = bool(level[-1])

    def finish(self) -> None:
        """Judge every event: no recording will come."""
        self._read(self._core.finish())
        self._samples.finish()

    def _observe(self, blocks: Iterable[FrameBlock]) -> None:
        for block in blocks:
            self._read(self._core.handle_many(block))
            self._samples.forget(self._core.processed)

    def _read(self, sent: list[OutputFrame]) -> None:
        """Note the samples processed since the last call, then the results of injections."""
        if self._keeps_frames:
            self.frames += sent
        observer, processed = self._core.compiled.observer, self._core.processed
        first, self._seen = max(self._seen, processed - RING), processed
        if first < processed:
            index = observer.ring["index"][np.arange(first, processed) % RING]
            self._samples.note(observer, first, index, self._nominal.rates(observer, first, processed))
        for news in self._news:
            match news:
                case InjectionReport():
                    run = self._samples.run_of(news)
                    run.sink.take_report(news, self._samples.injection(run, news))
                case MeasuredMass(report):
                    self._samples.run_of(report).sink.take_measured(news)
        self._news.clear()
        self._progress(processed)
