"""The compiled core alone: frames in arrays through compiled code, the floor under whatever reads files."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

from observer_rt.bus.links.link import FrameBlock
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench
from observer_rt.foundation.units import MICROSECOND, MILLISECOND
from observer_rt.recording.replay.recording_frames import Device
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.stream import HeldSignals
from observer_rt.service.core.core import Core
from observer_rt.simulation.schedule import Event, Shot
from tools.benchmarks.speed.traffic import SAMPLE_RATE, worn_recording

INJECTIONS, PERIOD, ENERGIZING = 50, 40 * MILLISECOND, 1.2 * MILLISECOND  # 25 a second, of three pressures
ONCE = INJECTIONS * PERIOD
"""Length of the injections that are repeated [s]."""


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
