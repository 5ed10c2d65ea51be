"""Frames of three blocks on one bus, with faults cut into them, and what the watch says of them."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.recording.replay.framing import TimedFrame
from observer_rt.recording.signals.recording import Recording
from observer_rt.service.core.core import Core
from observer_rt.service.watch.input_watch import PERIOD, InputWatch

SECOND = 1_000_000_000
LIFT = "NeedleLiftBlock 0x111 (needle_lift)"
RAIL = "RailPressureBlock 0x110 (rail_pressure)"
LINE = "LinePressureBlock 0x112 (line_pressure)"


def told_of(bench: Path, frames: Sequence[TimedFrame], silence: float = 0.0) -> list[str]:
    """What the watch says of frames, by their times, and of so many seconds [s] without any after them.

    It looks while no frame comes, too.
    """
    loaded = load_bench(bench)
    bus = map_bus(loaded)
    core = Core(loaded.injector, bus, learning=False)
    watch = InputWatch(loaded.injector, bus, core)
    watch.arrivals.begin(frames[0].stamp_ns)
    told: list[str] = []
    due = frames[0].stamp_ns
    for frame in frames:
        while due < frame.stamp_ns - PERIOD:
            due += PERIOD
            told += [notice.text for notice in watch.look(due)]
        core.handle(frame.frame_id, frame.is_extended, frame.payload, frame.stamp_ns)
        watch.arrivals.note(0, frame.frame_id, frame.is_extended, frame.stamp_ns)
        if frame.stamp_ns >= due:
            due = frame.stamp_ns + PERIOD
            told += [notice.text for notice in watch.look(frame.stamp_ns)]
    for late in np.arange(0.0, silence, PERIOD / SECOND):
        told += [notice.text for notice in watch.look(frames[-1].stamp_ns + round(late * SECOND))]
    return told


def with_channel(recording: Recording, **change: Callable[[np.ndarray], np.ndarray]) -> Recording:
    """The recording with some of its signals changed."""
    changed = {name: law(getattr(recording, name)) for name, law in change.items()}
    return replace(recording, **changed)  # type: ignore[arg-type]
