"""Plays a scenario, with faults of the process, to the service's core as frames, and keeps what it published."""

import struct
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.links.link import BusFrame, Frame, block_of
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench
from observer_rt.daemon.state_file import load_knowledge, save_knowledge
from observer_rt.desk.evaluation.evaluation import Evaluation
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.engine.stream.state import Reason
from observer_rt.files.replay.framing import Framer, all_samples
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MILLIGRAM, MM3_PER_MS
from tests.plants.plant import Signals
from tools.benchmarks.faults import reasons as of
from tools.benchmarks.faults.fault import Fault, Frames, PlacedFault, Sent, Where
from tools.benchmarks.faults.frames import BLOCK_SAMPLES, with_frame_fault
from tools.benchmarks.faults.scenario import Scenario

DOWN = 0.15  # s from a kill until the service is there again
HUNG = Fault("learner_hung", Where.PROCESS, of.UNLEARNED)
FAILING = Fault("learner_failing", Where.PROCESS, of.UNLEARNED)
KILLED = Fault("killed_and_restarted", Where.PROCESS, of.AWAY, shortest=DOWN)
ROWS = (HUNG, FAILING, KILLED)
BLOCK = 32  # frames given at once
RATE_ID, SUMMARY_ID = 0x200, 0x201
_RATES = np.dtype([("head", "V3"), ("flags", "u1"), ("index", "<u4"), ("rates", "<u2", 28)])
_MISSING = 65535
_SUMMARY_MASS, _SUMMARY_REASON = 24, 23


class UnreliableExecutor(Executor):
    """Learns at once, or not until it is well again, or fails."""

    def __init__(self) -> None:
        self.kind: Fault | None = None
        """What it does wrong now."""
        self._waiting: list[tuple[Future[Any], Callable[[], Any]]] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self._waiting.append((future, lambda: fn(*args, **kwargs)))
        self.work()
        return future

    def work(self) -> None:
        while self._waiting and self.kind is not HUNG:
            future, job = self._waiting.pop(0)
            if self.kind is FAILING:
                future.set_exception(MemoryError("no memory to learn in"))
            else:
                future.set_result(job())


@dataclass(frozen=True)
class Summary:
    """An injection as published: first sample in the recording, mass [kg]."""

    first: int
    is_valid: bool
    mass: float
    reason: str


@dataclass
class Results:
    """By sample of the recording (n,): rates [m3/s], nan: none was published; whether they were valid."""

    rate: NDArray[np.float64]
    valid: NDArray[np.bool_]
    reason: list[tuple[int, str]] = field(default_factory=list)
    """Of the stream: from which sample on, by its first samples."""
    summaries: list[Summary] = field(default_factory=list)
    crash: str = ""


def play(scenario: Scenario, measured: Signals, bench: Bench) -> Results:
    """What the service publishes of a scenario; bench: as the bench file says."""
    bus = map_bus(bench)
    recording = Recording(measured.time, measured.rail_pressure, measured.needle_lift, measured.line_pressure)
    layouts = {(layout.bus, layout.frame_id): number for number, layout in enumerate(bus.input_layouts)}
    frames: Frames = [
        Sent(each.time, each.time, layouts[each.bus, each.frame_id], each.payload)
        for each in Framer(bus).frames(recording, all_samples(recording))
    ]
    for placed in scenario.placed:
        frames = with_frame_fault(frames, placed, bus)
    return _Player(scenario, bench, measured.time).play(frames)


def corrected(evaluation: Evaluation) -> Results:
    """What a recording's evaluation says afterwards: rates as corrected, valid where their injections are."""
    trace = evaluation.trace
    rate = np.where(np.isnan(trace.corrected_rate), trace.injection_rate, trace.corrected_rate)
    results = Results(rate, np.array(trace.valid))
    for report in evaluation.reports:
        first, last = report.start_index - evaluation.first_index, report.end_index - evaluation.first_index
        results.valid[first : last + 1] = report.valid
        results.reason.append((first, report.reason.name))
        results.summaries.append(Summary(first, report.valid, report.mass, report.reason.name))
    return results


class Receiver:
    """Puts published frames to the samples they are of."""

    def __init__(self, time: NDArray[np.float64]) -> None:
        self._time = time
        # by which the device's index was ahead of the recording's, from which sample on, the newest last
        self._moves = [(0, 0)]
        self.newest = 0
        """Sample sent last."""
        self._placed: dict[int, int] = {}  # sample of every index of which a rate came
        self.published = Results(np.full(time.size, np.nan), np.zeros(time.size, np.bool_))

    def note_sent(self, time: float, moved: int) -> None:
        """A frame was sent at a time [s] of the recording, its index so far ahead."""
        sample = round(time / (self._time[1] - self._time[0]))
        if moved != self._moves[-1][0]:
            self._moves.append((moved, sample))
        self.newest = max(self.newest, sample)

    def take(self, frames: Sequence[OutputFrame]) -> None:
        for frame in frames:
            if frame.frame_id == RATE_ID:
                self._take_rates(np.frombuffer(frame.payload, _RATES)[0])
            elif frame.frame_id == SUMMARY_ID:
                (index,) = struct.unpack_from("<I", frame.payload, 4)
                (mass,) = struct.unpack_from("<H", frame.payload, _SUMMARY_MASS)
                kilograms = np.nan if mass == _MISSING else (0.01 * mass - 50.0) * MILLIGRAM
                valid, reason = bool(frame.payload[3] & 1), Reason(frame.payload[_SUMMARY_REASON]).name
                first = self._placed.get(index, self._sample(index))
                self.published.summaries.append(Summary(first, valid, kilograms, reason))

    def _take_rates(self, row: np.void) -> None:
        index, raw = int(row["index"]), row["rates"]
        first = self._sample(index)
        rates = np.where(raw == _MISSING, np.nan, 0.01 * raw - 100.0) * MM3_PER_MS
        places = first + np.arange(rates.size)
        self._placed.update(zip(range(index, index + rates.size), places.tolist(), strict=True))
        inside = (places >= 0) & (places < self._time.size)
        self.published.rate[places[inside]] = rates[inside]
        self.published.valid[places[inside]] = bool(row["flags"] & 1) & np.isfinite(rates[inside])

    def _sample(self, index: int) -> int:
        """Sample of the recording that an index means: of the newest numbering in which it can have been sent."""
        for moved, since in reversed(self._moves):
            sample = (index - moved) & 0xFFFFFFFF
            if since - BLOCK_SAMPLES <= sample <= self.newest + BLOCK_SAMPLES:
                return sample
        return self._time.size


class _Player:
    def __init__(self, scenario: Scenario, bench: Bench, time: NDArray[np.float64]) -> None:
        self._bench, self._bus = bench, map_bus(bench)
        self._of_process = [each for each in scenario.placed if each.fault.where is Where.PROCESS]
        is_waited_for = all(each.fault is KILLED for each in self._of_process)
        self._executor = None if is_waited_for else UnreliableExecutor()
        self._start = partial(Core, bench.injector, self._bus, executor=self._executor, learning=scenario.learning)
        self._core = self._start()
        self._receiver = Receiver(time)

    def play(self, frames: Frames) -> Results:
        try:
            for first in range(0, len(frames), BLOCK):
                self._give(frames[first : first + BLOCK])
            self._receiver.take(self._core.finish())
        except Exception as error:  # whatever it is: that is what is looked for
            self._receiver.published.crash = f"{type(error).__name__}: {error}"
        return self._receiver.published

    def _give(self, frames: Frames) -> None:
        frames = [frame for frame in frames if not self._is_down(frame.time)]
        if not frames:
            return
        for frame in frames:
            if not frame.is_foreign:
                self._receiver.note_sent(frame.time, frame.moved)
        self._misbehave(frames[-1].time)
        layouts = self._bus.input_layouts
        handed_on = []
        for frame in frames:
            layout, stamp = layouts[frame.message], 1_700_000_000_000_000_000 + round(1e9 * frame.stamp)
            handed_on.append(BusFrame(layout.bus, Frame(layout.frame_id, frame.payload, stamp, layout.is_extended)))
        self._receiver.take(self._core.handle_many(block_of(handed_on)))
        _, reason = self._core.state
        said = self._receiver.published.reason
        if not said or said[-1][1] != reason.name:
            said.append((self._receiver.newest, reason.name))

    def _misbehave(self, time: float) -> None:
        """What the process does wrong now."""
        if self._executor is None:
            return
        now = [each.fault for each in self._of_process if each.fault is not KILLED and each.begin <= time < each.end]
        self._executor.kind = now[0] if now else None
        self._executor.work()

    def _is_down(self, time: float) -> bool:
        """Whether the service was killed and is not back; it comes back with what it had saved."""
        for fault in self._of_process:
            if fault.fault is KILLED and fault.begin <= time:
                if time < fault.begin + DOWN:
                    return True
                self._restart(fault)
        return False

    def _restart(self, placed: PlacedFault) -> None:
        self._of_process.remove(placed)
        model = self._bench.injector.parameters
        with TemporaryDirectory(prefix="faults-") as folder:
            save_knowledge(Path(folder) / "state.json", self._core.knowledge, model)
            restored = load_knowledge(Path(folder) / "state.json", model)
        self._core = self._start(restored.knowledge)
