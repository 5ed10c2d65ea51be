"""Faults of bus and time: what becomes of frames on their way."""

import struct
from dataclasses import replace

import numpy as np
from numpy.random import Generator

from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.core.frames.frames import protect_frame
from tools.benchmarks.faults import reasons as of
from tools.benchmarks.faults.fault import FrameFault, Frames, PlacedFault, Sent, Where
from tools.benchmarks.speed.traffic import index_of

LOST = (0.01, 0.5)  # share of the frames
BURST = 20e-3  # s
CLOCK_STEP = (1.0, 3600.0)  # s
INDEX_JUMP = (1, 5000)  # samples
_INDEX_AT, _COUNTER_AT = 4, 2


def _lost(frames: Frames, rng: Generator, bus: BusMap) -> Frames:
    share = rng.uniform(*LOST)
    return [frame for frame in frames if rng.random() >= share]


def _lost_burst(frames: Frames, rng: Generator, bus: BusMap) -> Frames:
    begin = rng.uniform(frames[0].time, frames[-1].time)
    return [frame for frame in frames if not begin <= frame.time < begin + BURST]


def _message_away(frames: Frames, rng: Generator, bus: BusMap) -> Frames:
    gone = int(rng.integers(len(bus.input_layouts)))
    return [frame for frame in frames if frame.message != gone]


def _reordered(frames: Frames, rng: Generator, bus: BusMap) -> Frames:
    frames = list(frames)
    for position in range(1, len(frames)):
        if rng.random() < 0.1:
            frames[position - 1], frames[position] = frames[position], frames[position - 1]
    return frames


def _foreign(frames: Frames, rng: Generator, bus: BusMap) -> Frames:
    """Another node sends under the same identifiers: the same device's frames of a while before."""
    old = frames[: len(frames) // 2]
    later = zip(old, frames[len(old) :], strict=False)
    theirs = [replace(each, time=then.time, is_foreign=True) for each, then in later]
    return sorted([*frames, *theirs], key=lambda frame: frame.time)


def _clock_step(frames: Frames, rng: Generator, bus: BusMap) -> Frames:
    step = rng.uniform(*CLOCK_STEP) * rng.choice((-1.0, 1.0))
    return [replace(each, stamp=each.stamp + step) for each in frames]


def _index_jump(frames: Frames, rng: Generator, bus: BusMap) -> Frames:
    jump = int(rng.integers(*INDEX_JUMP))
    return [_rewritten(each, bus, moved=jump * BLOCK_SAMPLES) for each in frames]


def _restarted(frames: Frames, rng: Generator, bus: BusMap) -> Frames:
    first = min(index_of(each.payload) for each in frames)
    return [_rewritten(each, bus, moved=-first) for each in frames]


BLOCK_SAMPLES = 252  # samples: a whole number of frames of any of the example's messages
_B, _C = Where.BUS, Where.CLOCK
ROWS = (
    FrameFault("frames_lost", _B, of.LOST, change=_lost),
    FrameFault("burst_lost", _B, of.LOST, change=_lost_burst),
    FrameFault("message_away", _B, of.LOST, change=_message_away),
    FrameFault("duplicated", _B, of.LOST,
        change=lambda frames, rng, _: [copy for each in frames for copy in (each,) * (1 + int(rng.random() < 0.3))]),
    FrameFault("reordered", _B, of.LOST, change=_reordered),
    FrameFault("wrong_counter", _B, of.LOST,
        change=lambda frames, rng, bus: [_rewritten(each, bus, counter=int(rng.integers(256))) for each in frames]),
    FrameFault("wrong_crc", _B, of.LOST,
        change=lambda frames, rng, _: [_flipped(each, rng) if rng.random() < 0.1 else each for each in frames]),
    FrameFault("foreign_sender", _B, of.LOST | {"DEVICE_RESTARTED"}, change=_foreign),
    FrameFault("clock_step", _C, of.TIMES, change=_clock_step, stays=True),
    FrameFault("index_jump", _C, of.TIMES, change=_index_jump, stays=True),
    FrameFault("device_restart", _C, of.TIMES, change=_restarted, stays=True),
)  # fmt: skip


def with_frame_fault(frames: Frames, placed: PlacedFault, bus: BusMap) -> Frames:
    """The frames with a fault of the bus or of a clock; with any other the same."""
    fault = placed.fault
    if not isinstance(fault, FrameFault):
        return frames
    before = [each for each in frames if each.time < placed.begin]
    during = [each for each in frames if placed.begin <= each.time and (fault.stays or each.time < placed.end)]
    after = frames[len(before) + len(during) :]
    return [*before, *(fault.change(during, placed.chance, bus) if during else ()), *after]


def _rewritten(frame: Sent, bus: BusMap, moved: int = 0, counter: int | None = None) -> Sent:
    """The frame with another index or counter, its check sum right."""
    layout, payload = bus.input_layouts[frame.message], np.frombuffer(frame.payload, np.uint8).copy()
    index = (index_of(frame.payload) + moved) & 0xFFFFFFFF
    payload[_INDEX_AT : _INDEX_AT + 4] = np.frombuffer(struct.pack("<I", index), np.uint8)
    said = int(payload[_COUNTER_AT]) if counter is None else counter
    protect_frame(payload, layout.length, layout.protection, said)
    return replace(frame, payload=payload.tobytes(), moved=frame.moved + moved)


def _flipped(frame: Sent, rng: Generator) -> Sent:
    bit = int(rng.integers(8 * len(frame.payload)))
    payload = bytearray(frame.payload)
    payload[bit // 8] ^= 1 << bit % 8
    return replace(frame, payload=bytes(payload))
