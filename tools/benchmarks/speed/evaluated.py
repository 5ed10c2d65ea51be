"""How fast recordings run through `evaluate`, beside the compiled core alone on the same frames."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from rich.console import Console

from observer_rt.bus.frame_block import FrameBlock
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench, load_injector
from observer_rt.evaluation.convert import convert
from observer_rt.evaluation.logged import LoggedSignals
from observer_rt.evaluation.streamed import evaluate_stream
from observer_rt.foundation.units import MICROSECOND, MILLISECOND
from observer_rt.model.effects import sized
from observer_rt.recording.formats import open_recording
from observer_rt.recording.replay.device import Device
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.stream import HeldSignals, SignalStream
from observer_rt.service.core.core import Core
from observer_rt.simulation.measurement import NoiseLevels
from observer_rt.simulation.schedule import Event, Schedule, Shot
from observer_rt.simulation.simulate import simulate
from tools.benchmarks.scoring import bench_at
from tools.benchmarks.speed.traffic import SAMPLE_RATE

ARRAYS, PARQUET, MDF4, CAN_LOG = "arrays", "parquet", "mf4", "mf4 CAN log"
INJECTIONS, PERIOD, ENERGIZING = 50, 40 * MILLISECOND, 1.2 * MILLISECOND  # 25 a second, of three pressures
REPEATED = 15  # times: 30 s
PASSES = 3


@dataclass(frozen=True)
class EvaluateTimes:
    """Microseconds a sample, wall time of the fastest of interleaved passes; nothing is learned.

    core: compiled code, frames in arrays; verdicts: what Python does beside when events are judged; whole: from a
    source to its results, by source. seconds: of the recording.
    """

    seconds: float
    core: float
    verdicts: float
    whole: dict[str, float]

    def share(self, source: str) -> float:
        """Of the core's speed."""
        return self.core / self.whole[source]


def measure_evaluate(folder: Path) -> EvaluateTimes:
    """Time the core and every source in turn, several times."""
    bench, recording = bench_at(SAMPLE_RATE), _recording()
    sources = _sources(folder, bench, recording)
    device, held = Device(map_bus(bench)), HeldSignals(recording)
    device.begin(SAMPLE_RATE)
    blocks = [block for chunk in device.chunks(held.chunks()) for block in device.blocks(chunk)]
    core, verdicts, whole = [], [], {name: [] for name in sources}  # type: ignore[var-annotated]
    for _ in range(1 + PASSES):
        compiled, answered = _core_alone(bench, blocks)
        core.append(compiled)
        verdicts.append(answered)
        for name, opened in sources.items():
            begin = time.perf_counter()
            evaluate_stream(bench, [opened()], learning=False)
            whole[name].append(time.perf_counter() - begin)

    def us(times: Sequence[float]) -> float:
        return min(times[1:]) / recording.samples / MICROSECOND

    found = {name: us(times) for name, times in whole.items()}
    return EvaluateTimes(recording.samples / SAMPLE_RATE, us(core), us(verdicts), found)


def _recording() -> Recording:
    """Injections of a worn injector, again and again."""
    events = tuple(
        Event((n + 0.5) * PERIOD, (60e6, 100e6, 140e6)[n * 3 // INJECTIONS], (Shot(ENERGIZING),))
        for n in range(INJECTIONS)
    )
    schedule = Schedule(events, INJECTIONS * PERIOD - 1.0 / SAMPLE_RATE)
    worn = (sized("orifice_area", v_H=0.2),)
    once = simulate(load_injector(), schedule, SAMPLE_RATE, worn, NoiseLevels(), seed=1).recording
    rail, lift, line = (np.tile(values, REPEATED) for values in once.signals.values())
    return Recording(np.arange(rail.size) / SAMPLE_RATE, rail, lift, line)


def _sources(folder: Path, bench: Bench, recording: Recording) -> dict[str, Callable[[], SignalStream]]:
    """How each is opened, the same samples in all."""
    from observer_rt.recording.signals.writers import write_whole

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


def _core_alone(bench: Bench, blocks: Sequence[FrameBlock]) -> tuple[float, float]:
    """Seconds in compiled code, and beside it."""
    core = Core(bench.injector, map_bus(bench), learning=False)
    compiled = 0.0

    def timed(call: Callable[..., Any]) -> Callable[..., Any]:
        def run(*arguments: Any) -> Any:
            nonlocal compiled
            begin = time.perf_counter()
            result = call(*arguments)
            compiled += time.perf_counter() - begin
            return result

        return run

    pipeline = core.compiled
    with (
        patch.object(pipeline, "take_many", timed(pipeline.take_many)),
        patch.object(pipeline, "proceed", timed(pipeline.proceed)),
    ):
        begin = time.perf_counter()
        for block in blocks:
            core.handle_many(block)
        core.finish()
        return compiled, time.perf_counter() - begin - compiled
