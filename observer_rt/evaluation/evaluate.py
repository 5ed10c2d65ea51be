"""Recordings through the same core as the daemon, as fast as the machine allows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping import BusMap, map_bus
from observer_rt.config import Bench
from observer_rt.observer.learning import Knowledge
from observer_rt.observer.standstill import Standstill
from observer_rt.observer.state import State
from observer_rt.recording.framing import Framer, bench_for, whole
from observer_rt.recording.recording import Recording
from observer_rt.service.core import Core, Counters
from observer_rt.service.output import OutputFrame
from observer_rt.service.report import InjectionReport

Progress = Callable[[int, int], None]  # samples done, samples in all
_READ_EVERY = 64  # frames between two looks at the observer's memory


@dataclass(frozen=True)
class Trace:
    """The observer at every sample of a recording (n samples); nan where not available.

    injection_rate [m3/s]; state: `State`; x normalised (n, 3); phi [1/s] (n, 3); nominal_rate [m3/s]: the model
    with phi = 0 on the same frames.
    """

    injection_rate: NDArray[np.float64]
    valid: NDArray[np.bool_]
    state: NDArray[np.int8]
    x: NDArray[np.float64]
    phi: NDArray[np.float64]
    nominal_rate: NDArray[np.float64]


@dataclass(frozen=True)
class Evaluation:
    """One recording evaluated; `first_index` is the sample index its first sample was sent with."""

    recording: Recording
    first_index: int
    trace: Trace
    reports: tuple[InjectionReport, ...]
    counters: Counters
    standstill: Standstill


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
) -> History:
    """Evaluate recordings as one history, learning in lockstep.

    Every recording goes through the bench's bus codec, so that the result equals that of the daemon bit for bit.
    Raises `UserError` for a recording whose sample rate is not the bench's.
    """
    bench = bench_for(bench, recordings[0])
    for recording in recordings[1:]:
        bench_for(bench, recording)
    run = _Run(bench, map_bus(bench), knowledge, learning, sum(r.samples for r in recordings), progress)
    counters = []
    for recording in recordings:
        run.take(recording)
        counters.append((run.core.counters, run.core.standstill))
    run.finish()
    counters[-1] = (run.core.counters, run.core.standstill)
    evaluations = []
    first = 0
    for recording, (counts, standstill) in zip(recordings, counters, strict=True):
        end = first + recording.samples
        reports = tuple(r for r in run.reports if first <= r.start_index < end)
        evaluations.append(Evaluation(recording, first, run.trace(first, end), reports, counts, standstill))
        first = end
    return History(tuple(evaluations), run.core.knowledge, tuple(run.frames))


class _Run:
    """The observer and, beside it, the nominal model on the same frames."""

    def __init__(
        self,
        bench: Bench,
        bus: BusMap,
        knowledge: Knowledge | None,
        learning: bool,
        samples: int,
        progress: Progress | None,
    ) -> None:
        self.reports: list[InjectionReport] = []
        self.frames: list[OutputFrame] = []
        self.core = Core(bench, bus, knowledge, learning=learning, on_report=self.reports.append)
        self._nominal = Core(bench, bus, learning=False)
        self._framer = Framer(bus)
        self._progress = progress or (lambda done, total: None)
        self._samples = samples
        self._seen = 0
        self._nominal_seen = 0
        self._rate = np.full(samples, np.nan)
        self._nominal_rate = np.full(samples, np.nan)
        self._valid = np.zeros(samples, np.bool_)
        self._state = np.full(samples, State.STARTING, np.int8)
        self._x = np.full((samples, 3), np.nan)
        self._phi = np.full((samples, 3), np.nan)

    def take(self, recording: Recording) -> None:
        for count, frame in enumerate(self._framer.frames(recording, whole(recording))):
            self.frames += self.core.handle(frame.frame_id, frame.is_extended, frame.payload)
            self._nominal.handle(frame.frame_id, frame.is_extended, frame.payload)
            if count % _READ_EVERY == 0:
                self._read()

    def finish(self) -> None:
        self.frames += self.core.finish()
        self._nominal.finish()
        self._read()

    def trace(self, start: int, end: int) -> Trace:
        return Trace(
            self._rate[start:end],
            self._valid[start:end],
            self._state[start:end],
            self._x[start:end],
            self._phi[start:end],
            self._nominal_rate[start:end],
        )

    def _read(self) -> None:
        rows = self.core.rows(self._seen, self.core.processed)
        self._seen = self.core.processed
        index = rows["index"]
        available = ~np.isnan(rows["injection_rate"])
        self._rate[index] = rows["injection_rate"]
        self._valid[index] = rows["valid"]
        self._state[index] = rows["state"]
        self._x[index[available]] = rows["x_hat"][available]
        self._phi[index[available]] = rows["phi"][available]
        nominal = self._nominal.rows(self._nominal_seen, self._nominal.processed)
        self._nominal_seen = self._nominal.processed
        self._nominal_rate[nominal["index"]] = nominal["injection_rate"]
        self._progress(self._seen, self._samples)
