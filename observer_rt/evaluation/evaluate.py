"""Recordings through the same core as the daemon, as fast as the machine allows."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.database.frame_key import frame_key
from observer_rt.bus.links.link import BusFrame, Frame
from observer_rt.bus.mapping.bus_map import BusMap, map_bus
from observer_rt.config.bench import Bench
from observer_rt.evaluation.logged import LoggedRecording
from observer_rt.foundation.errors import UserError
from observer_rt.observer.learning.knowledge import Knowledge
from observer_rt.observer.stream.standstill import Standstill
from observer_rt.observer.stream.state import State
from observer_rt.recording.replay.framing import Framer, TimedFrame, bench_for, message_timing, whole
from observer_rt.recording.signals.recording import Recording
from observer_rt.service.core.core import Core
from observer_rt.service.core.counters import Counters
from observer_rt.service.core.learners import LearnerFactory, make_learner
from observer_rt.service.core.messages import OutputFrame
from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.reports.news import MeasuredMass, Notes

Signal = NDArray[np.float64]
Progress = Callable[[int], None]  # samples done
NANOSECONDS = 1e9  # in a second
PAUSE = 1.0  # s, between two recordings of a history
_READ_EVERY = 64  # frames between two looks at the observer's memory


@dataclass(frozen=True)
class Trace:
    """The observer at every sample of a recording (n samples); nan where not available.

    injection_rate [m3/s]; injection_rate_sigma [m3/s]: its standard deviation over the windows of injections that
    were learned from; state: `State`; x normalised (n, 3); phi [1/s] (n, 3); nominal_rate [m3/s]: the model
    with phi = 0 on the same frames.
    """

    injection_rate: Signal
    injection_rate_sigma: Signal
    valid: NDArray[np.bool_]
    state: NDArray[np.int8]
    x: Signal
    phi: Signal
    nominal_rate: Signal

    @classmethod
    def unavailable(cls, samples: int, state: State) -> Self:
        """The observer in one state, nothing available."""
        rate, sigma, nominal = np.full((3, samples), np.nan)
        x, phi = np.full((2, samples, 3), np.nan)
        return cls(
            rate, sigma, np.zeros(samples, np.bool_), np.full(samples, state, np.int8), x, phi, nominal
        )


@dataclass(frozen=True)
class Evaluation:
    """One recording evaluated.

    first_index: the sample index its first sample was sent with; measured: masses measured online, as a log of the
    bus has them; has_energizing: whether the bench has this input, so that reports and counters tell of commands.
    """

    recording: Recording
    first_index: int
    trace: Trace
    reports: tuple[InjectionReport, ...]
    counters: Counters
    standstill: Standstill
    measured: tuple[MeasuredMass, ...] = ()
    has_energizing: bool = False


@dataclass(frozen=True)
class History:
    """Recordings evaluated one after another by one observer, and what it knows at the end."""

    evaluations: tuple[Evaluation, ...]
    knowledge: Knowledge
    frames: tuple[OutputFrame, ...]


def evaluate(
    bench: Bench,
    recordings: Sequence[Recording],
    knowledge: Knowledge | None = None,
    learning: bool = True,
    progress: Progress | None = None,
    learner_of: LearnerFactory = make_learner,
) -> History:
    """Evaluate recordings as one history, learning in lockstep.

    Every recording goes through the bench's bus codec, so that the result equals that of the daemon bit for bit.
    Between two recordings the sample index jumps, as between two windows of a windowed source.
    Raises `UserError` for a recording whose sample rate is not the bench's.
    """
    bench = bench_for(bench, recordings[0])
    for recording in recordings[1:]:
        if bench_for(bench, recording).injector.config.sampling != bench.injector.config.sampling:
            raise UserError(
                str(recording.path),
                f"is sampled at {recording.sample_rate:g} Hz, {recordings[0].path} before it at "
                f"{recordings[0].sample_rate:g} Hz",
                "recordings of one history must have one sample rate",
            )
    fuel_temperature = bench.injector.parameters.fluid.reference_temperature  # a recording knows none
    run = _Run(bench, map_bus(bench), knowledge, learning, progress, learner_of, fuel_temperature)
    for recording in recordings:
        run.take(recording)
    run.finish()
    return run.history()


def evaluate_logs(
    bench: Bench,
    logs: Sequence[LoggedRecording],
    knowledge: Knowledge | None = None,
    learning: bool = True,
    progress: Progress | None = None,
) -> History:
    """Evaluate the frames of CAN logs as they are, as the daemon would have on the bus; else as `evaluate`.

    The sample index of every log must go on beyond that of the one before.
    """
    run = _Run(bench, map_bus(bench), knowledge, learning, progress, make_learner)
    for log in logs:
        run.take_frames(log.recording, log.first_index, log.frames)
    run.finish()
    return run.history()


class _Part:
    """What is seen of one recording while it is evaluated."""

    def __init__(self, recording: Recording, first_index: int) -> None:
        self.recording = recording
        self.first_index = first_index
        self.trace = Trace.unavailable(recording.samples, State.STARTING)

    def places(self, rows: NDArray[np.void]) -> tuple[NDArray[np.void], NDArray[np.int64]]:
        """The rows that belong to this recording, and their places in it."""
        place = rows["index"] - self.first_index
        mine = (place >= 0) & (place < self.recording.samples)
        return rows[mine], place[mine]

    def note(self, rows: NDArray[np.void]) -> None:
        rows, place = self.places(rows)
        trace = self.trace
        available = ~np.isnan(rows["injection_rate"])
        trace.injection_rate[place] = rows["injection_rate"]
        trace.valid[place] = rows["valid"]
        trace.state[place] = rows["state"]
        trace.x[place[available]] = rows["x_hat"][available, :3]
        trace.phi[place[available]] = rows["phi"][available]

    def note_report(self, report: InjectionReport) -> None:
        if report.rate_sigma is not None:
            start = report.start_index - self.first_index
            sigma = self.trace.injection_rate_sigma[start : start + len(report.rate_sigma)]
            sigma[:] = report.rate_sigma[: len(sigma)]

    def note_nominal(self, rows: NDArray[np.void]) -> None:
        rows, place = self.places(rows)
        self.trace.nominal_rate[place] = rows["injection_rate"]


class _Run:
    """The observer and, beside it, the nominal model on the same frames."""

    def __init__(
        self,
        bench: Bench,
        bus: BusMap,
        knowledge: Knowledge | None,
        learning: bool,
        progress: Progress | None,
        learner_of: LearnerFactory,
        fuel_temperature: float | None = None,
    ) -> None:
        self._notes = Notes()
        self._frames: list[OutputFrame] = []
        self._core = Core(
            bench.injector,
            bus,
            knowledge,
            learning=learning,
            listeners=[self._notes],
            learner_of=learner_of,
            fuel_temperature=fuel_temperature,
        )
        self._nominal = Core(bench.injector, bus, learning=False, fuel_temperature=fuel_temperature)
        self._framer = Framer(bus)
        self._delays = {
            frame_key(layout.frame_id, layout.is_extended, layout.bus): round(
                float(message_timing(bus, number)["delay"]) * NANOSECONDS
            )
            for number, layout in enumerate(bus.input_layouts)
        }
        self._progress = progress or (lambda _: None)
        self._seen = 0
        self._nominal_seen = 0
        self._parts: list[_Part] = []
        self._ends: list[tuple[Counters, Standstill]] = []

    def take(self, recording: Recording) -> None:
        if self._parts:
            self._framer.pause(round(PAUSE * recording.sample_rate))
        first_index = self._framer.next_index
        start = round(first_index / recording.sample_rate * NANOSECONDS)
        frames = self._framer.frames(recording, whole(recording))
        self.take_frames(recording, first_index, (self._received(frame, start) for frame in frames))

    def take_frames(self, recording: Recording, first_index: int, frames: Iterable[BusFrame]) -> None:
        """Observe frames, which carry the samples of a recording from an index on."""
        self._parts.append(_Part(recording, first_index))
        for count, (bus, frame) in enumerate(frames):
            frame_id, is_extended, payload, stamp = (
                frame.frame_id,
                frame.is_extended,
                frame.payload,
                frame.stamp_ns,
            )
            self._frames += self._core.handle(frame_id, is_extended, payload, stamp, bus)
            self._nominal.handle(frame_id, is_extended, payload, stamp, bus)
            if count % _READ_EVERY == 0:
                self._read()
        self._read()
        self._ends.append((self._core.counters, self._core.standstill))

    def _received(self, frame: TimedFrame, start: int) -> BusFrame:
        delay = self._delays[frame_key(frame.frame_id, frame.is_extended, frame.bus)]
        stamp = start + frame.stamp_ns + delay
        return BusFrame(
            frame.bus, Frame(frame.frame_id, frame.payload, stamp, frame.is_extended, frame.is_fd)
        )

    def finish(self) -> None:
        self._frames += self._core.finish()
        self._nominal.finish()
        self._read()
        self._ends[-1] = (self._core.counters, self._core.standstill)

    def history(self) -> History:
        evaluations = []
        before = self._ends[0][0].since(self._ends[0][0])
        for part, (counters, standstill) in zip(self._parts, self._ends, strict=True):
            end = part.first_index + part.recording.samples
            reports = tuple(r for r in self._notes.injections if part.first_index <= r.start_index < end)
            measured = tuple(
                m for m in self._notes.measured if part.first_index <= m.report.start_index < end
            )
            for report in reports:
                part.note_report(report)
            evaluations.append(
                Evaluation(
                    part.recording,
                    part.first_index,
                    part.trace,
                    reports,
                    counters.since(before),
                    standstill,
                    measured,
                    self._core.energizing is not None,
                )
            )
            before = counters
        return History(tuple(evaluations), self._core.knowledge, tuple(self._frames))

    def _read(self) -> None:
        """Note what was processed since the last look; the end of one recording shows with the next one's start."""
        rows = self._core.rows(self._seen, self._core.processed)
        nominal_rows = self._nominal.rows(self._nominal_seen, self._nominal.processed)
        self._seen = self._core.processed
        self._nominal_seen = self._nominal.processed
        for part in self._parts[-2:]:
            part.note(rows)
            part.note_nominal(nominal_rows)
        self._progress(self._seen)
