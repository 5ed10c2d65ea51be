"""Where tests make frames: those of a measuring device, what befalls them on the way, what a core makes of them.

`frames_of` encodes by the bench file, `encoded` by plain cantools; a `Result` is read by cantools and autosar-e2e.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any, NamedTuple

import e2e.p05
import numpy as np
from cantools.database.can import Message

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import EXAMPLE_BENCH, Bench, load_bench, load_injector
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.engine.reports.injection_report import InjectionReport
from observer_rt.engine.reports.news import MeasuredMass, MissingInjection, News, Notice
from observer_rt.engine.service.core import Core
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.engine.words import Topic
from observer_rt.files.formats import read_recording
from observer_rt.files.replay.framing import Framer, Span, TimedFrame, all_samples, grid_samples
from observer_rt.files.signals.recording import Recording
from observer_rt.model.effects import sized
from tests.benches import SAMPLE_RATE
from tests.daemon.end_to_end import DATABASE, RATE, SUMMARY

EPOCH = 1_700_000_000_000_000_000  # ns, of the receiver's clock when a recording begins
NOT_AVAILABLE = 0xFFFF
RATES = 28  # in a frame
INDICES = 1 << 32  # of samples, before their count begins again


@cache
def simulated(
    injections: int = 3,
    v_h: float = 0.2,
    pressures: tuple[float, ...] = (100e6,),
    rate: float = SAMPLE_RATE,
    seed: int = 8,
    measured_rate: bool = False,
) -> Recording:
    """Injections every 50 ms, the first 0.15 s in, at rail pressures [Pa] in turn, with noise; three take 0.3 s."""
    schedule = make_schedule(list(pressures), injections, 0.05, [1.1e-3])
    effects = (sized("orifice_area", v_H=v_h),)
    return simulate(load_injector(), schedule, rate, effects, SimulatedNoise(), measured_rate, seed).recording


def worn_recording(injections: int = 4, v_h: float = 0.3) -> Recording:
    return simulated(injections, v_h, (60e6, 120e6), seed=3)


class Device:
    """Sends recordings in whole frames, whose counters go on from call to call; index: of the first sample."""

    def __init__(self, bench: Path | Bench = EXAMPLE_BENCH, index: int = 0) -> None:
        self.index = index
        bus = map_bus(_loaded(bench))
        self._framer = Framer(bus)
        self._block = math.lcm(*(grid_samples(bus, number) for number in range(len(bus.input_layouts))))

    def send(self, recording: Recording, *spans: Span) -> list[TimedFrame]:
        """The samples of some spans, or all, in order of time: a frame comes with its last sample."""
        self._framer.next_index = self.index
        filled = [
            Span(span.start, span.end - (span.end - span.start) % self._block)
            for span in spans or all_samples(recording)
        ]
        return list(self._framer.frames(recording, filled))


def frames_of(
    bench: Path | Bench, recording: Path | Recording, spans: Sequence[Span] | None = None
) -> list[TimedFrame]:
    """As `replay` sends a recording: where its end, or a span's, fills no frame, the rest is "not available"."""
    samples = recording if isinstance(recording, Recording) else read_recording(recording)
    return list(Framer(map_bus(_loaded(bench))).frames(samples, all_samples(samples) if spans is None else spans))


def encoded(
    message: Message, values: Mapping[str, float] | bytes, time: float = 0.0, scaling: bool = True
) -> TimedFrame:
    """A frame of any message, sent at a time [s], of signals by name or of the payload itself."""
    payload = values if isinstance(values, bytes) else message.encode(dict(values), scaling=scaling)
    return TimedFrame(time, message.frame_id, message.is_extended_frame, message.is_fd, payload)


def protected(frame: TimedFrame, data_id: int, counter: int) -> TimedFrame:
    """The frame with counter and CRC of E2E profile 5."""
    payload = bytearray(frame.payload)
    payload[2] = counter % 256
    e2e.p05.e2e_p05_protect(payload, data_id, length=len(payload), increment_counter=False)
    return frame._replace(payload=bytes(payload))


def recoded(frame: TimedFrame, **codes: int) -> TimedFrame:
    """The frame of our own database with other raw codes of some signals, well protected."""
    message = DATABASE.get_message_by_frame_id(frame.frame_id)
    values = message.decode(frame.payload, scaling=False, decode_choices=False) | codes
    changed = encoded(message, message.encode(values, scaling=False, strict=False), frame.time)
    return protected(changed, message.frame_id, values["Counter"])


def damaged(frame: TimedFrame, bit: int) -> TimedFrame:
    payload = bytearray(frame.payload)
    payload[bit // 8] ^= 1 << (bit % 8)
    return frame._replace(payload=bytes(payload))


def later(frames: Iterable[TimedFrame], seconds: float) -> list[TimedFrame]:
    return [frame._replace(time=frame.time + seconds) for frame in frames]


def inserted(frames: Sequence[TimedFrame], at: Iterable[tuple[int, TimedFrame]]) -> list[TimedFrame]:
    """The frames with others before those of the numbers given, at the same times."""
    others = list(at)
    result: list[TimedFrame] = []
    for number, frame in enumerate(frames):
        result += [other._replace(time=frame.time) for place, other in others if place == number]
        result.append(frame)
    return result


def merged(*sources: Iterable[TimedFrame]) -> list[TimedFrame]:
    return sorted((frame for source in sources for frame in source), key=lambda frame: frame.time)


def delayed(frames: Sequence[TimedFrame], seconds: Sequence[float]) -> list[TimedFrame]:
    """The frames as read when those of each bus come so much later; within a bus their order stays."""
    return sorted(frames, key=lambda frame: frame.time + seconds[frame.bus])


def shuffled(frames: Sequence[TimedFrame], seconds: float, seed: int) -> list[TimedFrame]:
    """The frames of all buses interleaved at random, none read later than `seconds` after it was sent."""
    random = np.random.default_rng(seed)
    read = [0.0, 0.0, 0.0]
    moments = []
    for frame in frames:
        read[frame.bus] = max(read[frame.bus], frame.time + random.uniform(0.0, seconds))
        moments.append(read[frame.bus])
    order = sorted(range(len(frames)), key=lambda n: (moments[n], frames[n].bus, n))
    return [frames[n] for n in order]


def candump_lines(frames: Iterable[TimedFrame], channels: Sequence[str] = ("can0",)) -> list[str]:
    """The frames as candump logs them, all as CAN FD; channels: of the buses."""
    return [f"({f.time:.9f}) {channels[f.bus]} {f.frame_id:03X}##1{f.payload.hex()}\n" for f in frames]


@dataclass
class Notes:
    injections: list[InjectionReport] = field(default_factory=list)
    measured: list[MeasuredMass] = field(default_factory=list)
    missing: list[MissingInjection] = field(default_factory=list)
    notices: list[Notice] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)

    def __call__(self, news: News) -> None:
        kinds = InjectionReport, MeasuredMass, MissingInjection, Notice
        kept: tuple[list[Any], ...] = self.injections, self.measured, self.missing, self.notices
        kept[kinds.index(type(news))].append(news)
        if isinstance(news, Notice) and news.topic is Topic.LINK:
            self.messages.append(news.text)


@dataclass(frozen=True, eq=False)
class Result:
    """What a core made of frames: frames to send, and news. Frames are decoded once."""

    core: Core
    frames: list[OutputFrame]
    notes: Notes

    @property
    def reports(self) -> list[InjectionReport]:
        return self.notes.injections

    @property
    def commands(self) -> list[int | None]:
        return [report.commanded.command if report.commanded else None for report in self.reports]

    @property
    def energized(self) -> tuple[list[int | None], list[int]]:
        """Numbers of the injections' commands, and of commands without an injection."""
        return self.commands, [each.command for each in self.notes.missing]

    @cached_property
    def rate_frames(self) -> list[tuple[int, dict[str, int], list[int]]]:
        """First index, header and raw codes of every `InjectionRate` frame, its protection checked."""
        frames: list[tuple[int, dict[str, int], list[int]]] = []
        for frame in self.frames:
            if frame.frame_id != RATE.frame_id:
                continue
            assert e2e.p05.e2e_p05_check(frame.payload, RATE.frame_id, length=64)
            header = RATE.decode(frame.payload, scaling=False, decode_choices=False)
            assert header["Counter"] == len(frames) % 256
            frames.append((header["SampleIndex"], header, [header[f"InjectionRate_{k:02d}"] for k in range(RATES)]))
        return frames

    @cached_property
    def rates(self) -> dict[int, int]:
        """Raw code by sample index, not available left out; every index at most once."""
        codes: dict[int, int] = {}
        for first, _, values in self.rate_frames:
            for k, code in enumerate(values):
                if code != NOT_AVAILABLE:
                    assert first + k not in codes, f"index {first + k} is published twice"
                    codes[first + k] = code
        return codes

    @cached_property
    def covered(self) -> list[int]:
        """Indices the frames speak of, available or not."""
        return [first + k for first, _, _ in self.rate_frames for k in range(RATES)]

    @cached_property
    def summaries(self) -> list[dict[str, float]]:
        frames = [frame for frame in self.frames if frame.frame_id == SUMMARY.frame_id]
        assert all(e2e.p05.e2e_p05_check(f.payload, SUMMARY.frame_id, length=48) for f in frames)
        return [SUMMARY.decode(frame.payload, decode_choices=False) for frame in frames]


def core_of(bench: Path | Bench, **options: Any) -> Core:
    loaded = _loaded(bench)
    return Core(loaded.injector, map_bus(loaded), **options)


def run(bench: Path | Bench, frames: Iterable[TimedFrame], **options: Any) -> Result:
    """Frames through a fresh core in lockstep, to the end, stamped by their times; options: of `Core`."""
    notes = Notes()
    core = core_of(bench, listeners=[notes], **options)
    out = hand(core, frames)
    return Result(core, out + core.finish(), notes)


class Traffic(NamedTuple):
    bench: Path
    frames: list[TimedFrame]
    result: Result

    def run(self, frames: Iterable[TimedFrame], **options: Any) -> Result:
        """What it makes of others; options: of `Core`."""
        return run(self.bench, frames, **options)

    def without(self, number: int) -> Result:
        """What it makes of them when one is lost."""
        return self.run([*self.frames[:number], *self.frames[number + 1 :]])


def hand(core: Core, frames: Iterable[TimedFrame]) -> list[OutputFrame]:
    """Frames to a core, stamped by their times; what it answers at once."""
    out: list[OutputFrame] = []
    for frame in frames:
        out += core.handle(frame.frame_id, frame.is_extended, frame.payload, EPOCH + frame.stamp_ns, frame.bus)
    return out


def _loaded(bench: Path | Bench) -> Bench:
    """Of the example, whose recordings are simulated, everything is known exactly."""
    loaded = bench if isinstance(bench, Bench) else load_bench(bench)
    return loaded.exact if bench == EXAMPLE_BENCH else loaded
