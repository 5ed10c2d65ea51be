"""A pulse generator that tells when it energizes the injector: its database, and its frames by plain cantools."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench, load_injector
from observer_rt.recording.signals.recording import Recording
from observer_rt.service.core.core import Core
from observer_rt.service.core.messages import OutputFrame
from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.reports.news import Mismatch, Notes
from observer_rt.simulation.measurement import NoiseLevels
from observer_rt.simulation.schedule import Schedule, Shot, make_schedule
from observer_rt.simulation.simulate import simulate
from tests.service.core_frames import ONE_MESSAGE, SAMPLE_RATE, Device, Frame, protected
from tests.service.pulse_bench import BED, DATA_ID, LEVELS

BLOCK = 9  # samples in a frame of the measuring device
EPOCH = 1_700_000_000_000_000_000  # ns, of the receiver's clock


@dataclass(frozen=True)
class Sent:
    """A frame, and when it comes [s]; its stamp is that, unless it is late."""

    time: float
    frame: Frame


@cache
def injected(injections: int, shots: tuple[Shot, ...] = (Shot(1.1e-3),)) -> tuple[Schedule, Recording]:
    """Events every 50 ms, the first 0.15 s in, of a healthy injector, with noise."""
    schedule = make_schedule([100e6], injections, 0.05, shots=shots)
    return schedule, simulate(load_injector(), schedule, SAMPLE_RATE, (), NoiseLevels(), seed=8).recording


def commands(schedule: Schedule) -> list[tuple[float, float]]:
    """Start and duration [s] of all energizings."""
    return [(event.start + shot.offset, shot.duration) for event in schedule.events for shot in event.shots]


def samples(recording: Recording, *spans: tuple[float, float], device: Device | None = None) -> list[Sent]:
    """Blocks of the samples in spans of time [s], or all; each comes with its last sample."""
    sender = device or Device(ONE_MESSAGE)
    sent = []
    for begin, end in spans or ((0.0, recording.samples / SAMPLE_RATE),):
        first = round(begin * SAMPLE_RATE)
        for number, frame in enumerate(sender.send(recording, first, round(end * SAMPLE_RATE))):
            last = first + (number + 1) * BLOCK - 1
            sent.append(Sent(last / SAMPLE_RATE, frame))
    return sent


def index_at(time: float, offset: int = 0) -> int:
    """Index of the first sample at or after a time [s]."""
    return (round(time * SAMPLE_RATE) + offset) % (1 << 32)


def level_frame(name: str, level: int, index: int | None = None) -> Frame:
    message = BED.get_message_by_name(name)
    values = {"Energized": level} | ({} if index is None else {"PulseIndex": index})
    return Frame(message.frame_id, message.encode(values, scaling=False))


def on_change(pulses: Iterable[tuple[float, float]], offset: int = 0) -> list[Sent]:
    """`PulseLevel` as energizing starts and ends."""
    sent = []
    for start, duration in pulses:
        for time, level in ((start, 1), (start + duration, 0)):
            sent.append(Sent(time, level_frame("PulseLevel", level, index_at(time, offset))))
    return sent


def duration_frame(duration: float, index: int = 0) -> Frame:
    message = BED.get_message_by_name("PulseTime")
    return Frame(message.frame_id, message.encode({"Duration": duration / 1e-6, "PulseIndex": index}))


def durations(pulses: Iterable[tuple[float, float]]) -> list[Sent]:
    """`PulseTime` as energizing starts."""
    return [Sent(start, duration_frame(duration, index_at(start))) for start, duration in pulses]


def safe_durations(pulses: Iterable[tuple[float, float]]) -> list[Sent]:
    """`PulseSafe` as energizing starts, its counter going on."""
    message = BED.get_message_by_name("PulseSafe")
    sent = []
    for counter, (start, duration) in enumerate(pulses):
        payload = bytearray(message.encode({"Duration": duration / 1e-6}))
        sent.append(Sent(start, Frame(message.frame_id, protected(payload, DATA_ID, counter % 256))))
    return sent


def is_on(pulses: Sequence[tuple[float, float]], time: float) -> bool:
    return any(start <= time < start + duration for start, duration in pulses)


def cyclic(pulses: Sequence[tuple[float, float]], end: float, phase: float = 0.0004) -> list[Sent]:
    """`PulseCyclic` every millisecond."""
    times = (phase + 1e-3 * np.arange(int((end - phase) / 1e-3))).tolist()
    return [Sent(time, level_frame("PulseCyclic", int(is_on(pulses, time)))) for time in times]


def blocks(pulses: Sequence[tuple[float, float]], begin: float, end: float, offset: int = 0) -> list[Sent]:
    """`PulseBlock`: levels of all samples, each block with its last one."""
    message = BED.get_message_by_name("PulseBlock")
    sent = []
    for first in range(round(begin * SAMPLE_RATE), round(end * SAMPLE_RATE) - LEVELS + 1, LEVELS):
        values: dict[str, int] = {"SampleIndex": (first + offset) % (1 << 32)}
        for k in range(LEVELS):
            values[f"Level_{k:02d}"] = int(is_on(pulses, (first + k) / SAMPLE_RATE + 1e-9))
        payload = message.encode(values)
        sent.append(Sent((first + LEVELS - 1) / SAMPLE_RATE, Frame(message.frame_id, payload)))
    return sent


def safe_blocks(pulses: Sequence[tuple[float, float]], *spans: tuple[float, float]) -> list[Sent]:
    """The same as `PulseSafeBlock` in spans of time [s], its counter going on from span to span."""
    message = BED.get_message_by_name("PulseSafeBlock")
    plain = BED.get_message_by_name("PulseBlock")
    sent = []
    for counter, one in enumerate(one for span in spans for one in blocks(pulses, *span)):
        values = plain.decode_simple(one.frame.payload)
        renamed = {f"Safe{name.replace('Sample', '')}": value for name, value in values.items()}
        payload = protected(bytearray(message.encode(renamed)), DATA_ID, counter % 256)
        sent.append(Sent(one.time, Frame(message.frame_id, payload)))
    return sent


@dataclass(frozen=True)
class Watched:
    """What a core made of frames."""

    core: Core
    frames: list[OutputFrame]
    reports: list[InjectionReport]
    mismatches: list[Mismatch]

    @property
    def commands(self) -> list[int | None]:
        """Numbers of the injections' commands."""
        return [report.commanded.command if report.commanded else None for report in self.reports]

    @property
    def missing(self) -> list[int]:
        """Numbers of the commands without an injection."""
        return [one.number for one in self.mismatches if one.is_missing]

    @property
    def uncommanded(self) -> list[int]:
        """Numbers of the injections without a command."""
        return [one.number for one in self.mismatches if not one.is_missing]


def watch(
    bench: Path, *sources: Iterable[Sent], learning: bool = False, stamps: Sequence[int] = ()
) -> Watched:
    """The frames of all sources through a core, in order of time; stamps: theirs, else that time."""
    loaded = load_bench(bench)
    notes = Notes()
    core = Core(
        loaded.injector,
        map_bus(loaded),
        learning=learning,
        listeners=[notes],
    )
    out: list[OutputFrame] = []
    frames = sorted((one for source in sources for one in source), key=lambda one: one.time)
    for number, sent in enumerate(frames):
        stamp = stamps[number] if stamps else EPOCH + round(sent.time * 1e9)
        out += core.handle(sent.frame.frame_id, False, sent.frame.payload, stamp)
    out += core.finish()
    return Watched(core, out, notes.injections, notes.mismatches)


def misfired(recording: Recording, *spans: tuple[float, float]) -> Recording:
    """The needle stays shut in spans of time [s]; its sensor is as noisy as ever, or it would be a dropout."""
    lift = recording.needle_lift.copy()
    shut = np.random.default_rng(1).normal(size=lift.size) * NoiseLevels().needle_lift
    for begin, end in spans:
        span = slice(round(begin * SAMPLE_RATE), round(end * SAMPLE_RATE))
        lift[span] = shut[span]
    return replace(recording, needle_lift=lift)
