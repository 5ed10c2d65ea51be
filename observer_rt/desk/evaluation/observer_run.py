"""Runs observer and nominal model over samples of recordings, and keeps samples that an injection may still need."""

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from observer_rt.bus.links.link import FrameBlock, blocks_of
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.core.stream.stream import RING
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.desk.evaluation.logged import LoggedSignals
from observer_rt.desk.evaluation.lost_commands import LostCommands
from observer_rt.desk.evaluation.trace import SAMPLE, InjectionSamples, Trace, trace_of, unknown
from observer_rt.engine.observer import WINDOW_LEAD, energize
from observer_rt.engine.reports.injection_report import CommandedOpening, InjectionReport
from observer_rt.engine.reports.news import MeasuredMass, News
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.engine.service.nominal import NominalModel
from observer_rt.engine.stream.state import Observer, Reason
from observer_rt.files.replay.recording_frames import Device
from observer_rt.files.signals.recording import Chunk
from observer_rt.files.signals.stream import SAMPLES_AT_ONCE, SignalStream, cut
from observer_rt.foundation.units import Bools, Floats, Ints
from observer_rt.model.surroundings import Surroundings

LONGEST_DELAY = 3e-3  # s from a command to the opening that answers it
PIECE = 5e-3  # s of a recording, in which the surroundings are the same
Progress = Callable[[int], None]  # samples done
LOOK_BACK = RING  # samples that the observer remembers, and an injection may need


@dataclass(eq=False)
class Run:
    """Samples that were sent with a rising index."""

    sink: Evaluation  # gets them in order, and their injections
    samples: int
    rate: float
    first_index: int  # of the first one, as sent
    offset: int = 0  # of a log: number of the first one in it
    start: float = 0.0  # of a recording: time of the first one [s]
    number: int = 0  # of the first one in the history
    position: int | None = None  # of the first one that came, in the observer's stream; None: none has come yet

    @property
    def end(self) -> int:
        """Number after its last sample."""
        return self.number + self.samples

    def times(self, numbers: Ints) -> Floats:
        """Times [s] (n,) of samples by their numbers, where a log brings no times of its own."""
        return np.asarray(self.start + (self.offset + numbers - self.number) / self.rate)


class HistorySamples:
    """Samples that were sent, with what the observer made of them, until no injection can need them any more."""

    def __init__(self) -> None:
        self._runs: list[Run] = []
        self._memory = np.empty(0, SAMPLE)
        self._held = slice(0, 0)  # of the memory
        self._handed_over = 0  # samples
        self._oldest = self._current = 0  # run to be handed over next, and of the last sample that came
        self._last_index = -1
        self._marks: deque[tuple[int, int]] = deque()  # positions in the observer's stream, and sample numbers

    @property
    def held(self) -> Trace:
        """Samples remembered, by number, without those of a log that never came."""
        return trace_of(self._memory[self._held])

    def begin(self, run: Run) -> None:
        """Begin a run, whose samples come next."""
        run.number = self._runs[-1].end if self._runs else 0
        self._runs.append(run)

    def give(self, first: int, time: Floats, measured_rate: Floats | None) -> None:
        """Append samples of a recording, (n,), from that number of the last run on."""
        samples = unknown(self._runs[-1].number + first, time)
        if measured_rate is not None:
            samples.measured_rate = measured_rate
        self._append(samples)

    def note(self, observer: Observer, position: int, index: Ints, nominal: Floats) -> None:
        """Take the observer's results from a position on; index (n,): as sent; nominal (n,): of the model [m3/s]."""
        for run, first, part in self._by_run(index):
            if run.position is None:
                run.position = position + first
            inside = np.flatnonzero((part >= run.first_index) & (part - run.first_index < run.samples))
            if not inside.size:
                continue
            numbers = run.number + part[inside] - run.first_index
            self._marks.append((position + first, int(numbers[0])))
            held = self.held
            if not held.size or numbers[-1] > held.number[-1]:  # of a log
                new = numbers[numbers > (held.number[-1] if held.size else -1)]
                samples = unknown(0, run.times(new))
                samples.number = new
                self._append(samples)
            places = np.searchsorted(self.held.number, numbers)
            self._note(observer, (position + first + inside) % RING, places, nominal[first + inside])

    def _note(self, observer: Observer, rows: Ints, places: Ints, nominal: Floats) -> None:
        ring, trace = observer.ring, self.held
        trace.line_pressure[places] = np.where(ring["interpolated"][rows], np.nan, ring["line_pressure"][rows])
        trace.nominal_rate[places] = nominal
        for name in ("injection_rate", "open_loop_rate", "valid", "state"):
            trace[name][places] = ring[name][rows]
        trace.injection_rate_sigma[places] = ring["rate_sigma"][rows]
        is_known = ~np.isnan(ring["injection_rate"][rows])
        trace.x[places[is_known]] = observer.x_hat[rows[is_known], :3]
        trace.phi[places[is_known]] = ring["phi"][rows[is_known]]

    def _by_run(self, index: Ints) -> Iterator[tuple[Run, int, Ints]]:
        """Split samples by the run they belong to: it, and the place of the first and the indices of its samples."""
        begins_anew = set(np.flatnonzero(np.diff(index, prepend=self._last_index) <= 0).tolist())
        for begin, end in pairwise(sorted({0, *begins_anew, len(index)})):
            self._current += begin in begins_anew
            first = begin
            while first < end:
                self._current = min(self._current, len(self._runs) - 1)
                here, after = self._runs[self._current], self._runs[self._current + 1 :][:1]
                stop = end
                if after and after[0].first_index >= here.first_index + here.samples:  # else it begins anew
                    stop = first + int(np.searchsorted(index[first:end], after[0].first_index))
                if stop > first:
                    yield here, first, index[first:stop]
                self._current += stop < end
                first = stop
        self._last_index = int(index[-1]) if len(index) else self._last_index

    def run_of(self, report: InjectionReport) -> Run:
        """The run in which an injection began."""
        positions = [(run.position, run) for run in self._runs if run.position is not None]
        before = [run for position, run in positions if position <= report.start_position]
        return before[-1] if before else positions[0][1]

    def injection(self, run: Run, report: InjectionReport) -> InjectionSamples:
        """The window of an injection; notes the standard deviation of its rate, and the corrected rate."""
        first, last = (run.number + index - run.first_index for index in (report.start_index, report.end_index))
        held = self.held
        window = trace_of(held[slice(*np.searchsorted(held.number, [first, last + 1]))])
        for name, course in (("corrected_rate_sigma", report.rate_sigma), ("corrected_rate", report.corrected_rate)):
            if course is not None:
                window[name] = course[window.number - first]
        start, end = (self._time(run, number) for number in (first, last))
        is_whole = bool(window.size) and int(window.number[0]) == first == int(window.number[-1]) + 1 - window.size
        return InjectionSamples(window, start, end, is_whole)

    def _time(self, run: Run, number: int) -> float:
        """Time [s] of a sample, be it remembered or not."""
        row = np.searchsorted(self.held.number, number)
        if row < self.held.size and self.held.number[row] == number:
            return float(self.held.time[row])
        return float(run.times(np.array([number]))[0])

    def forget(self, processed: int) -> None:
        """Hand over what lies so far back that no injection will need it. processed: samples of the observer."""
        end = self._handed_over
        while self._marks and self._marks[0][0] <= processed - LOOK_BACK:
            end = max(end, self._marks.popleft()[1])
        self._hand_over(end)

    def finish(self) -> None:
        """Hand over all samples: no further results will come."""
        self._hand_over(self._runs[-1].end)

    def _hand_over(self, end: int) -> None:
        """Hand over samples up to a number; samples of a log that never came count as unknown."""
        while self._handed_over < end:
            run = self._runs[self._oldest]
            stop = min(end, run.end)
            count = int(np.searchsorted(self.held.number, stop))
            here = trace_of(self.held[:count])
            holes = np.flatnonzero(np.diff(here.number) > 1) + 1
            for part in (trace_of(rows) for rows in np.split(here, holes) if count):
                self._hand_over_unknown(run, int(part.number[0]))
                run.sink.take_samples(part)
                self._handed_over += part.size
            self._hand_over_unknown(run, stop)
            self._held = slice(self._held.start + count, self._held.stop)
            self._oldest += stop == run.end

    def _hand_over_unknown(self, run: Run, end: int) -> None:
        while self._handed_over < end:
            stop = min(end, self._handed_over + SAMPLES_AT_ONCE)
            run.sink.take_samples(unknown(self._handed_over, run.times(np.arange(self._handed_over, stop))))
            self._handed_over = stop

    def _append(self, samples: Trace) -> None:
        held = self._memory[self._held]
        if self._held.stop + samples.size > len(self._memory):
            if 2 * (len(held) + samples.size) > len(self._memory):
                self._memory = np.empty(3 * (len(held) + samples.size), SAMPLE)
            self._memory[: len(held)] = held
            self._held = slice(0, len(held))
        end = self._held.stop + samples.size
        self._memory[self._held.stop : end] = samples
        self._held = slice(self._held.start, end)


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
        self._is_energized, self._energized_from = False, 0  # index of the last command's first sample
        self._commands: list[tuple[int, int]] = []  # first indices and lengths, in samples
        self._lost = LostCommands(core)
        self._last = self._added = 0, 0  # number and event of the observer's last one; how many without a command

    def observe(self, source: SignalStream, sink: Evaluation) -> None:
        """Observe the frames of a log, or a recording in frames, whose sample index jumps between stretches."""
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
                sink.commands += self._energize(start_index + chunk.first, chunk.energizing > 0.5)
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

    def _energize(self, first_index: int, level: Bools) -> int:
        """Tell the observer the commands in samples (n,) of a level, which no frame carries; how many began."""
        observer, edges = self._core.compiled.observer, np.flatnonzero(np.diff(level, prepend=self._is_energized))
        count = observer.memory["commands"]["count"]  # (1,), of all so far
        for row in edges.tolist():
            if level[row]:
                self._energized_from = first_index + row
                energize(observer, int(count[0]), self._energized_from)
            else:
                length = first_index + row - self._energized_from
                energize(observer, int(count[0]) - 1, self._energized_from, length)
                self._commands.append((self._energized_from, length))
        self._is_energized = bool(level[-1])
        return int(np.count_nonzero(level[edges]))

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
        results = [news for news in self._news if isinstance(news, InjectionReport | MeasuredMass)]
        for news in sorted([*results, *self._lost.reports()], key=_position):
            match news:
                case InjectionReport():
                    run, report = self._samples.run_of(news), self._numbered(self._with_command(news))
                    run.sink.take_report(report, self._samples.injection(run, report))
                case MeasuredMass(report):
                    self._samples.run_of(report).sink.take_measured(replace(news, report=self._numbered(report)))
        self._news.clear()
        self._progress(processed)

    def _with_command(self, report: InjectionReport) -> InjectionReport:
        """The report with the command of the recording that it answers, the last one before it opened."""
        rate = 1.0 / self._core.compiled.observer.constants.interval
        opening = report.start_index + round(WINDOW_LEAD * rate)
        number = bisect_right(self._commands, (opening, 0)) - 1
        if report.commanded or report.reason is Reason.NO_COMMAND or number < 0:
            return report
        start, length = self._commands[number]
        delay = (opening - start) / rate
        if delay > LONGEST_DELAY:
            return report
        return replace(report, commanded=CommandedOpening(number + 1, delay, length / rate))

    def _numbered(self, report: InjectionReport) -> InjectionReport:
        """The report with its number and event among all, those without a command included."""
        numbers = self._last
        if report.reason is Reason.NO_COMMAND:
            self._added = self._added[0] + 1, report.event
        else:
            numbers = self._last = report.number, report.event
        return replace(report, number=numbers[0] + self._added[0], event=numbers[1] + self._added[1])


def _position(news: InjectionReport | MeasuredMass) -> int:
    return (news.report if isinstance(news, MeasuredMass) else news).start_position
