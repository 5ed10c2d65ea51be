"""The compiled core alone, the floor under whatever reads files, and `evaluate` beside it on the same frames."""

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
from observer_rt.evaluation.convert import convert
from observer_rt.evaluation.evaluate import evaluate_stream
from observer_rt.evaluation.logged import LoggedSignals
from observer_rt.foundation.units import MICROSECOND, MILLISECOND
from observer_rt.recording.formats import open_recording
from observer_rt.recording.replay.recording_frames import Device
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.stream import HeldSignals, SignalStream
from observer_rt.service.core.core import Core
from observer_rt.simulation.schedule import Event, Shot
from tools.benchmarks.scoring import bench_at
from tools.benchmarks.speed.traffic import SAMPLE_RATE, worn_recording

INJECTIONS, PERIOD, ENERGIZING = 50, 40 * MILLISECOND, 1.2 * MILLISECOND  # 25 a second, of three pressures
ONCE = INJECTIONS * PERIOD
"""Length of the injections that are repeated [s]."""
ARRAYS, PARQUET, MDF4, CAN_LOG = "arrays", "parquet", "mf4", "mf4 CAN log"
REPEATED = 15  # times: 30 s
PASSES = 3


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


def _sources(folder: Path, bench: Bench, recording: Recording) -> dict[str, Callable[[], SignalStream]]:
    """How each is opened, the same samples in all."""
    from observer_rt.recording.signals.table_writers import write_whole

    quiet = Console(quiet=True)
    parquet, mdf4, log = folder / "evaluated.parquet", folder / "evaluated.mf4", folder / "frames.mf4"
    for path in (parquet, mdf4):
        write_whole(path, recording)
    trace = folder / "frames.blf"
    convert(mdf4, trace, bench, (), True, quiet)
    convert(trace, log, None, (), True, quiet)
    return {
        ARRAYS: lambda: HeldSignals(recording),
        PARQUET: lambda: open_recording(parquet, bench.injector),
        MDF4: lambda: open_recording(mdf4, bench.injector),
        CAN_LOG: lambda: LoggedSignals(bench, log),
    }
