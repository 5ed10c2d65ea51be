"""What one frame of nine samples costs in Python and compiled code, and what of it the way into compiled code."""

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MICROSECOND, MILLISECOND
from observer_rt.recording.replay.framing import Framer, whole
from observer_rt.recording.signals.recording import Recording
from observer_rt.service.core.core import Core
from tools.benchmarks.scoring import bench_at

SAMPLE_RATE = 100e3  # Hz
PERIOD, OPEN = 60 * MILLISECOND, 1.5 * MILLISECOND
BLOCK = 200  # frames timed together: the median block has few open needles, the shortest none
UNKNOWN_ID = 1  # of a frame that is none of ours


class FrameTime(NamedTuple):
    """Microseconds of the fastest and of the median block of calls."""

    fastest: float
    median: float


class FrameTimes(NamedTuple):
    """A compiled function that does nothing; the pipeline, given a frame that is none of ours; a frame of samples."""

    bare_call: FrameTime
    border: FrameTime
    frame: FrameTime


def measure_frame_times(seconds: float = 2.0) -> FrameTimes:
    """Send injections of so many seconds through a core that does not learn, frame by frame."""
    bench = bench_at(SAMPLE_RATE)
    bus = map_bus(bench)
    core = Core(bench.injector, bus, learning=False)
    recording = _recording(seconds)
    frames = list(Framer(bus).frames(recording, whole(recording)))
    calls = [
        (frame.frame_id, frame.is_extended, frame.payload, frame.stamp_ns, frame.bus) for frame in frames
    ]
    payload = np.frombuffer(frames[0].payload, np.uint8)
    number = len(calls) // BLOCK
    for call in calls[:BLOCK]:
        core.handle(*call)
    return FrameTimes(
        _timed(lambda _: _nothing(0), number),
        _timed(lambda _: core.compiled.handle(UNKNOWN_ID, payload, 0), number),
        _timed(lambda n: core.handle(*calls[n + BLOCK]), number - 1),
    )


def frame_lines(times: FrameTimes) -> str:
    """One line each."""
    return "\n".join(
        f"{name.replace('_', ' '):10} {time.fastest:7.2f} us fastest, {time.median:7.2f} us median"
        for name, time in times._asdict().items()
    )


@njit(cache=True)
def _nothing(argument: int) -> int:
    return argument


def _recording(seconds: float) -> Recording:
    moments = np.arange(round(seconds * SAMPLE_RATE)) / SAMPLE_RATE
    pressure = 100 * MEGAPASCAL + 0.1 * MEGAPASCAL * np.random.default_rng(1).normal(size=len(moments))
    lift = np.where(moments % PERIOD > PERIOD - OPEN, 200 * MICROMETRE, 0.0)
    return Recording(moments, pressure, lift, pressure)


def _timed(call: Callable[[int], object], blocks: int) -> FrameTime:
    """Blocks of calls, each given the number of its call."""
    durations = []
    for block in range(blocks):
        begin = time.perf_counter()
        for n in range(block * BLOCK, (block + 1) * BLOCK):
            call(n)
        durations.append((time.perf_counter() - begin) / BLOCK / MICROSECOND)
    return FrameTime(min(durations), float(np.median(durations)))
