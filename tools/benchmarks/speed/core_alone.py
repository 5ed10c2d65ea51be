"""The compiled core alone, the floor under whatever reads files; `evaluate` beside it; what a sample costs as
numbers grow: samples, integration steps, samples in a frame (the network's five hidden neurons are fixed).
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from rich.console import Console

from observer_rt.bus.links.link import FrameBlock
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench
from observer_rt.desk.evaluation.convert import convert
from observer_rt.desk.evaluation.evaluate import evaluate_stream
from observer_rt.desk.evaluation.logged import LoggedSignals
from observer_rt.desk.simulation.schedule import Event, Shot
from observer_rt.engine.service.constants import bench_constants
from observer_rt.engine.service.core import Core
from observer_rt.files.formats import open_recording
from observer_rt.files.replay.framing import Framer, whole
from observer_rt.files.replay.recording_frames import Device
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import HeldSignals, SignalStream
from observer_rt.files.signals.table_writers import write_whole
from observer_rt.foundation.units import MICROSECOND, MILLISECOND
from tests.observed_plants import bench_at
from tools.benchmarks.scoring import with_signals
from tools.benchmarks.speed.sample import thread_seconds
from tools.benchmarks.speed.traffic import PERIOD, SAMPLE_RATE, worn_recording

INJECTIONS, ENERGIZING = 50, 1.2 * MILLISECOND  # 25 a second, of three pressures
ONCE = INJECTIONS * PERIOD
"""Length of the injections that are repeated [s]."""
ARRAYS, PARQUET, MDF4, CAN_LOG = "arrays", "parquet", "mf4", "mf4 CAN log"
SUFFIXES = {PARQUET: ".parquet", MDF4: ".mf4", CAN_LOG: ".mf4"}
REPEATED = 15  # times: 30 s
PASSES = 3
SECONDS = (0.25, 0.5, 1.0, 2.0)
RATES = (200e3, 100e3, 50e3, 20e3)  # Hz
BLOCKS = (1, 3, 9)  # samples in a frame of all three signals
PATTERNS = {
    "rail_pressure": "RailPressure_{:02d}",
    "needle_lift": "NeedleLift_{:02d}",
    "line_pressure": "LinePressure_{:02d}",
}


class Cost(NamedTuple):
    """Microseconds a sample: by the clock, and of processors, this process alone (MDF4 is read by another)."""

    wall: float
    processor: float


class Watch:
    """Adds up what runs while it does, pass by pass."""

    def __init__(self) -> None:
        self._passes = [Cost(0.0, 0.0)]  # s; the last one is under way

    @contextmanager
    def runs(self) -> Iterator[None]:
        """Watch what is done within."""
        wall, processor = time.perf_counter(), time.process_time()
        yield
        before = self._passes[-1]
        self._passes[-1] = Cost(
            before.wall + time.perf_counter() - wall, before.processor + time.process_time() - processor
        )

    def leave_out(self, other: "Watch") -> None:
        """What ran within."""
        mine, theirs = self._passes[-1], other._passes[-1]
        self._passes[-1] = Cost(mine.wall - theirs.wall, mine.processor - theirs.processor)

    def end_pass(self) -> None:
        """What follows is of the next one."""
        self._passes.append(Cost(0.0, 0.0))

    def least(self, samples: int) -> Cost:
        """Of all but the first pass, which compiles; a sample."""
        return Cost(*(min(times) / samples / MICROSECOND for times in zip(*self._passes[1:-1], strict=True)))


def repeated_injections(times: int, pressure_offset: float = 0.0) -> Recording:
    """Injections of a worn injector, again and again. pressure_offset: of the rail pressure [Pa]."""
    events = tuple(
        Event((n + 0.5) * PERIOD, (60e6, 100e6, 140e6)[n * 3 // INJECTIONS], (Shot(ENERGIZING),))
        for n in range(INJECTIONS)
    )
    once = worn_recording(events, ONCE - 1.0 / SAMPLE_RATE)
    rail, lift, line = (np.tile(values, times) for values in once.signals.values())
    return Recording(np.arange(rail.size) / SAMPLE_RATE, rail + pressure_offset, lift, line)


def frames_of(bench: Bench, recording: Recording) -> list[FrameBlock]:
    """A recording as the frames of a device."""
    device, held = Device(map_bus(bench)), HeldSignals(recording)
    device.begin(SAMPLE_RATE)
    return [block for chunk in device.chunks(held.chunks()) for block in device.blocks(chunk)]


def core_alone(bench: Bench, blocks: Sequence[FrameBlock], compiled: Watch, beside: Watch) -> None:
    """One pass over the frames: compiled code by one watch, what is done beside it by the other."""
    core = Core(bench.injector, map_bus(bench), learning=False)

    def timed(call: Callable[..., Any]) -> Callable[..., Any]:
        def run(*arguments: Any) -> Any:
            with compiled.runs():
                return call(*arguments)

        return run

    pipeline = core.compiled
    with (
        patch.object(pipeline, "take_many", timed(pipeline.take_many)),
        patch.object(pipeline, "proceed", timed(pipeline.proceed)),
        beside.runs(),
    ):
        for block in blocks:
            core.handle_many(block)
        core.finish()
    beside.leave_out(compiled)
    compiled.end_pass()
    beside.end_pass()


@dataclass(frozen=True)
class EvaluateTimes:
    """The least of interleaved passes; nothing is learned.

    core: compiled code, frames in arrays; verdicts: what Python does beside when events are judged; whole: from a
    source to its results, by source. seconds: of the recording.
    """

    seconds: float
    core: Cost
    verdicts: Cost
    whole: dict[str, Cost]

    def share(self, source: str) -> float:
        """Of the core's speed, by the clock."""
        return self.core.wall / self.whole[source].wall

    def processor_share(self, source: str) -> float:
        """The same by the time of processors."""
        return self.core.processor / self.whole[source].processor


def measure_evaluate(folder: Path) -> EvaluateTimes:
    """Time the core and every source in turn, several times."""
    bench, recording = bench_at(SAMPLE_RATE), repeated_injections(REPEATED)
    sources = _sources(folder, bench, recording)
    blocks = frames_of(bench, recording)
    core, verdicts = Watch(), Watch()
    whole = {name: Watch() for name in sources}
    for _ in range(1 + PASSES):
        core_alone(bench, blocks, core, verdicts)
        for name, opened in sources.items():
            with whole[name].runs():
                evaluate_stream(bench, [opened()], learning=False)
            whole[name].end_pass()
    samples = recording.samples
    found = {name: watch.least(samples) for name, watch in whole.items()}
    return EvaluateTimes(samples / SAMPLE_RATE, core.least(samples), verdicts.least(samples), found)


def write_source(source: str, path: Path, recording: Recording) -> None:
    """A recording as a file of a source; a log of its frames by way of files beside it, which go again."""
    if source != CAN_LOG:
        write_whole(path, recording)
        return
    signals, frames, quiet = path.with_suffix(".parquet"), path.with_suffix(".blf"), Console(quiet=True)
    write_whole(signals, recording)
    convert(signals, frames, bench_at(SAMPLE_RATE), (), True, quiet)
    convert(frames, path, None, (), True, quiet)
    signals.unlink()
    frames.unlink()


def _sources(folder: Path, bench: Bench, recording: Recording) -> dict[str, Callable[[], SignalStream]]:
    """How each is opened, the same samples in all."""
    files = {source: folder / f"evaluated_{n}{SUFFIXES[source]}" for n, source in enumerate(SUFFIXES)}
    for source, path in files.items():
        write_source(source, path, recording)
    return {
        ARRAYS: lambda: HeldSignals(recording),
        PARQUET: lambda: open_recording(files[PARQUET], bench.injector),
        MDF4: lambda: open_recording(files[MDF4], bench.injector),
        CAN_LOG: lambda: LoggedSignals(bench, files[CAN_LOG]),
    }


@dataclass(frozen=True)
class ScalingRow:
    """One point: microseconds a sample of one core, frames through the core and nothing learned."""

    what: str
    value: float
    us_a_sample: float


def measure_scaling() -> list[ScalingRow]:
    """All points, one after the other."""
    found = [
        ScalingRow(
            "samples", seconds * SAMPLE_RATE, _cost(bench_at(SAMPLE_RATE), _recording(SAMPLE_RATE, seconds))
        )
        for seconds in SECONDS
    ]
    for rate in RATES:
        bench = bench_at(rate)
        steps = bench_constants(bench.injector).substeps
        found.append(ScalingRow("substeps", steps, _cost(bench, _recording(rate, 0.25))))
    recording = _recording(SAMPLE_RATE, 0.25)
    found += [ScalingRow("block samples", block, _cost(_in_blocks(block), recording)) for block in BLOCKS]
    return found


def exponent(rows: Sequence[ScalingRow]) -> float:
    """Of the number of samples, by which the whole time grows; 1 is linear."""
    of_samples = [row for row in rows if row.what == "samples"]
    values = np.array([row.value for row in of_samples])
    times = np.array([row.us_a_sample for row in of_samples]) * values
    return float(np.polyfit(np.log(values), np.log(times), 1)[0])


def _recording(rate: float, seconds: float) -> Recording:
    """25 injections a second of a worn injector."""
    starts = 10 * MILLISECOND + PERIOD * np.arange(round(seconds / PERIOD))
    return worn_recording(tuple(Event(t, 100e6, (Shot(ENERGIZING),)) for t in starts.tolist()), seconds, rate)


def _in_blocks(block: int) -> Bench:
    """The example bench, of whose frames only the first samples count."""
    shorter = {
        role: {"pattern": None, "signals": [pattern.format(n) for n in range(block)]}
        for role, pattern in PATTERNS.items()
    }
    return with_signals(bench_at(SAMPLE_RATE), shorter)


def _cost(bench: Bench, recording: Recording) -> float:
    """Microseconds a sample of the fastest pass."""
    bus = map_bus(bench)
    frames = list(Framer(bus).frames(recording, whole(recording)))

    def one_pass() -> None:
        for frame in frames:
            core.handle(frame.frame_id, frame.is_extended, frame.payload, frame.stamp_ns, frame.bus)

    times = []
    for _ in range(PASSES):
        core = Core(bench.injector, bus, learning=False)
        times.append(thread_seconds(one_pass))
        assert core.processed > 0.9 * recording.samples
    return min(times) / recording.samples / MICROSECOND
