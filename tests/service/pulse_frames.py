"""A pulse generator that tells when it energizes the injector: its frames, beside those of the samples."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from observer_rt.config.bench import load_injector
from observer_rt.recording.replay.framing import Span, TimedFrame
from observer_rt.recording.signals.recording import Recording
from observer_rt.simulation.schedule import Shot, make_schedule
from observer_rt.simulation.simulate import SimulatedNoise, simulate
from tests.benches import SAMPLE_RATE
from tests.device import INDICES, Device, Result, encoded, merged, protected, run
from tests.service.pulse_bench import BED, DATA_ID, LEVELS, Told

MAIN = (Shot(1.1e-3),)
PILOT_AND_MAIN = (Shot(0.3e-3, -1.5e-3), Shot(1.0e-3))
Pulses = Sequence[tuple[float, float]]
"""Start and duration [s] of energizings."""


@cache
def injected(
    injections: int, shots: tuple[Shot, ...] = MAIN
) -> tuple[tuple[tuple[float, float], ...], Recording]:
    """Energizings of a healthy injector, events every 50 ms, the first 0.15 s in, and its samples with noise."""
    schedule = make_schedule([100e6], injections, 0.05, shots=shots)
    pulses = tuple(
        (event.start + shot.offset, shot.duration) for event in schedule.events for shot in event.shots
    )
    return pulses, simulate(load_injector(), schedule, SAMPLE_RATE, (), SimulatedNoise(), seed=8).recording


def samples(recording: Recording, *spans: tuple[float, float], index: int = 0) -> list[TimedFrame]:
    """Frames of our own layout with the samples in spans of time [s], or all; index: of the first sample."""
    sent = [Span(round(begin * SAMPLE_RATE), round(end * SAMPLE_RATE)) for begin, end in spans]
    return Device(index=index).send(recording, *sent)


def index_at(time: float, offset: int = 0) -> int:
    """Index of the first sample at or after a time [s]."""
    return (round(time * SAMPLE_RATE) + offset) % INDICES


def level_frame(name: str, level: int, time: float, index: int | None = None) -> TimedFrame:
    """A level and, where the message has one, the index [samples] at which it came, sent at a time [s]."""
    values = {"Energized": level} | ({} if index is None else {"PulseIndex": index})
    return encoded(BED.get_message_by_name(name), values, time, scaling=False)


def on_change(pulses: Pulses, offset: int = 0) -> list[TimedFrame]:
    """`PulseLevel` as energizing starts and ends."""
    return [
        level_frame("PulseLevel", level, time, index_at(time, offset))
        for start, duration in pulses
        for time, level in ((start, 1), (start + duration, 0))
    ]


def duration_frame(duration: float, time: float, index: int) -> TimedFrame:
    """`PulseTime`, sent at a time [s]."""
    values = {"Duration": duration / 1e-6, "PulseIndex": index}
    return encoded(BED.get_message_by_name("PulseTime"), values, time)


def durations(pulses: Pulses) -> list[TimedFrame]:
    """`PulseTime` as energizing starts."""
    return [duration_frame(duration, start, index_at(start)) for start, duration in pulses]


def safe_durations(pulses: Pulses) -> list[TimedFrame]:
    """`PulseSafe` as energizing starts, its counter going on."""
    message = BED.get_message_by_name("PulseSafe")
    return [
        protected(encoded(message, {"Duration": duration / 1e-6}, start), DATA_ID, counter)
        for counter, (start, duration) in enumerate(pulses)
    ]


def is_on(pulses: Pulses, time: float) -> bool:
    return any(start <= time < start + duration for start, duration in pulses)


def cyclic(pulses: Pulses, end: float, phase: float = 0.0004) -> list[TimedFrame]:
    """`PulseCyclic` every millisecond."""
    times = (phase + 1e-3 * np.arange(int((end - phase) / 1e-3))).tolist()
    return [level_frame("PulseCyclic", int(is_on(pulses, time)), time) for time in times]


def blocks(pulses: Pulses, begin: float, end: float) -> list[TimedFrame]:
    """`PulseBlock`: levels of all samples, each block with its last one."""
    message = BED.get_message_by_name("PulseBlock")
    sent = []
    for first in range(round(begin * SAMPLE_RATE), round(end * SAMPLE_RATE) - LEVELS + 1, LEVELS):
        values = {"SampleIndex": first}
        for k in range(LEVELS):
            values[f"Level_{k:02d}"] = int(is_on(pulses, (first + k) / SAMPLE_RATE + 1e-9))
        sent.append(encoded(message, values, (first + LEVELS - 1) / SAMPLE_RATE))
    return sent


def safe_blocks(pulses: Pulses, *spans: tuple[float, float]) -> list[TimedFrame]:
    """The same as `PulseSafeBlock` in spans of time [s], its counter going on from span to span."""
    message = BED.get_message_by_name("PulseSafeBlock")
    plain = BED.get_message_by_name("PulseBlock")
    sent = []
    for counter, one in enumerate(one for span in spans for one in blocks(pulses, *span)):
        values = plain.decode_simple(one.payload)
        renamed = {f"Safe{name.replace('Sample', '')}": value for name, value in values.items()}
        sent.append(protected(encoded(message, renamed, one.time), DATA_ID, counter))
    return sent


SOURCES: dict[str, tuple[str, Callable[[Pulses], list[TimedFrame]]]] = {
    "level": (Told.LEVEL, on_change),
    "duration": (Told.TIME, durations),
    "block": (Told.LEVELS_IN_BLOCK, lambda pulses: blocks(pulses, 0.0, 0.3)),
    "by stamp": (Told.TIME_BY_STAMP, durations),
    "protected": (Told.SAFE, safe_durations),
    "cyclic": (Told.CYCLIC, lambda pulses: cyclic(pulses, 0.3)),
}
"""Ways to tell of pulses: lines of [signals.energizing], and the frames."""


def watch(bench: Path, sent: Recording | Iterable[TimedFrame], *told: Iterable[TimedFrame]) -> Result:
    """Samples, of a whole recording or as frames, and what is told, by time, through a core that does not learn."""
    return run(bench, merged(samples(sent) if isinstance(sent, Recording) else sent, *told), learning=False)


def misfired(recording: Recording, *spans: tuple[float, float]) -> Recording:
    """The needle stays shut in spans of time [s]; its sensor is as noisy as ever, or it would be a dropout."""
    lift = recording.needle_lift.copy()
    shut = np.random.default_rng(1).normal(size=lift.size) * SimulatedNoise().needle_lift
    for begin, end in spans:
        span = slice(round(begin * SAMPLE_RATE), round(end * SAMPLE_RATE))
        lift[span] = shut[span]
    return replace(recording, needle_lift=lift)
