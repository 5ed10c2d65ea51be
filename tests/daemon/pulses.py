"""A pulse generator that tells when it energizes the injector: its database, bench files, and its frames."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import cantools
import numpy as np
from cantools.database.can import Database

from observer_rt.config.bench import EXAMPLE_BENCH, Bench, load_injector
from observer_rt.desk.simulation.schedule import Shot, make_schedule
from observer_rt.desk.simulation.simulate import SimulatedNoise, simulate
from observer_rt.files.replay.framing import Span, TimedFrame
from observer_rt.files.signals.recording import Recording
from tests.benches import ONE_MESSAGE, SAMPLE_RATE, attributes, sample_bench
from tests.device import INDICES, Device, Result, encoded, merged, protected, run

LEVELS = 20  # samples in a frame of levels
SAFE_ID, SAFE_BLOCK_ID, DATA_ID = 0x340, 0x341, 0x2345
LEVEL_SIGNALS = "\n".join(f' SG_ Level_{k:02d} : {32 + 8 * k}|8@1+ (1,0) [0|1] "" Bed' for k in range(LEVELS))
SAFE_LEVEL_SIGNALS = "\n".join(
    f' SG_ SafeLevel_{k:02d} : {64 + 8 * k}|8@1+ (1,0) [0|1] "" Bed' for k in range(LEVELS)
)
TEXT = f"""VERSION ""
BU_: Bed
BO_ 816 PulseLevel: 8 Bed
 SG_ Energized : 0|2@1+ (1,0) [0|3] "" Bed
 SG_ PulseIndex : 8|32@1+ (1,0) [0|0] "" Bed
BO_ 817 PulseTime: 8 Bed
 SG_ Duration : 0|16@1+ (0.1,0) [0|6000] "us" Bed
 SG_ PulseIndex : 16|32@1+ (1,0) [0|0] "" Bed
BO_ 818 PulseBlock: 24 Bed
 SG_ SampleIndex : 0|32@1+ (1,0) [0|0] "" Bed
{LEVEL_SIGNALS}
BO_ 819 PulseCyclic: 8 Bed
 SG_ Energized : 0|2@1+ (1,0) [0|3] "" Bed
BO_ 820 PulseVolts: 8 Bed
 SG_ Volts : 0|8@1+ (1,0) [0|100] "V" Bed
 SG_ Short : 8|16@1+ (1,0) [0|0] "" Bed
BO_ {SAFE_BLOCK_ID} PulseSafeBlock: 32 Bed
 SG_ SafeIndex : 32|32@1+ (1,0) [0|0] "" Bed
{SAFE_LEVEL_SIGNALS}
BO_ 821 BedStatus: 4 Bed
 SG_ MissingInjections : 0|16@1+ (1,0) [0|65535] "" Bed
BO_ 822 Triple: 8 Bed
 SG_ Rail : 0|16@1+ (0.005,-10) [0|0] "MPa" Bed
 SG_ Lift : 16|16@1+ (0.01,-50) [0|0] "um" Bed
 SG_ Line : 32|16@1+ (0.005,-10) [0|0] "MPa" Bed
 SG_ Level : 48|2@1+ (1,0) [0|3] "" Bed
 SG_ LevelPlain : 50|2@1+ (1,0) [0|3] "" Bed
 SG_ Time : 52|8@1- (1,-20) [0|0] "us" Bed
BO_ 823 Pages: 8 Bed
 SG_ Page M : 0|8@1+ (1,0) [0|255] "" Bed
 SG_ PageDuration m2 : 8|16@1+ (0.1,0) [0|6000] "us" Bed
 SG_ PageIndex m2 : 24|32@1+ (1,0) [0|0] "" Bed
 SG_ PageOther m1 : 8|16@1+ (1,0) [0|0] "" Bed
BO_ {SAFE_ID} PulseSafe: 8 Bed
 SG_ Duration : 24|16@1+ (0.1,0) [0|6000] "us" Bed
{attributes([818, SAFE_BLOCK_ID], {SAFE_BLOCK_ID: (5, DATA_ID), SAFE_ID: (5, DATA_ID)})}\
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 819 1;
VAL_ 816 Energized 3 "SNA" ;
VAL_ 822 Level 3 "SNA" ;
"""
BED: Database = cantools.database.load_string(TEXT, "dbc")


class EnergizingBy:
    LEVEL = 'message = "PulseLevel"\nsignal = "Energized"\nindex = "PulseIndex"\n'
    TIME = 'message = "PulseTime"\nsignal = "Duration"\nindex = "PulseIndex"\n'
    TIME_BY_STAMP = 'message = "PulseTime"\nsignal = "Duration"\n'
    LEVELS_IN_BLOCK = 'message = "PulseBlock"\npattern = "Level_{:02d}"\n'
    SAFE_BLOCK = 'message = "PulseSafeBlock"\npattern = "SafeLevel_{:02d}"\nindex = "SafeIndex"\n'
    CYCLIC = 'message = "PulseCyclic"\nsignal = "Energized"\n'
    SAFE = 'message = "PulseSafe"\nsignal = "Duration"\n'


def pulse_bench(folder: Path, energizing: str, extra: str = "", messages: Mapping[str, str] = ONE_MESSAGE) -> Path:
    (folder / "bed.dbc").write_text(TEXT)
    link = f'[link]\ninterface = "virtual"\nchannel = "{folder.name}"\n'
    return sample_bench(
        folder, messages, extra=f'{extra}\n{link}[[dbc]]\nfile = "bed.dbc"\n[signals.energizing]\n{energizing}'
    )


TRIPLE = {"rail_pressure": "Rail", "needle_lift": "Lift", "line_pressure": "Line"}
"""Signals of the message `Triple` that carry the roles."""


def triple_bench(folder: Path, signal: str) -> Path:
    """A bench whose samples come one a frame, without index, in the message that tells of the energizing."""
    path = pulse_bench(folder, f'message = "Triple"\nsignal = "{signal}"\n')
    text = path.read_text()
    for role, name in TRIPLE.items():
        start = text.index(f"[signals.{role}]")
        end = text.index("[", start + 1)
        text = f'{text[:start]}[signals.{role}]\nmessage = "Triple"\nsignal = "{name}"\n{text[end:]}'
    path.write_text(text)
    return path


MAIN = (Shot(1.1e-3),)
PILOT_AND_MAIN = (Shot(0.3e-3, -1.5e-3), Shot(1.0e-3))
Pulses = Sequence[tuple[float, float]]
"""Start and duration [s] of energizings."""


@cache
def injected(injections: int, shots: tuple[Shot, ...] = MAIN) -> tuple[tuple[tuple[float, float], ...], Recording]:
    """Energizings of a healthy injector, events every 50 ms, the first 0.15 s in, and its samples with noise."""
    schedule = make_schedule([100e6], injections, 0.05, shots=shots)
    pulses = tuple((event.start + shot.offset, shot.duration) for event in schedule.events for shot in event.shots)
    return pulses, simulate(load_injector(), schedule, SAMPLE_RATE, (), SimulatedNoise(), seed=8).recording


def samples(
    recording: Recording, *spans: tuple[float, float], index: int = 0, bench: Path | Bench = EXAMPLE_BENCH
) -> list[TimedFrame]:
    """Frames of a bench with the samples in spans of time [s], or all; index: of the first sample."""
    sent = [Span(round(begin * SAMPLE_RATE), round(end * SAMPLE_RATE)) for begin, end in spans]
    return Device(bench, index).send(recording, *sent)


def index_at(time: float, offset: int = 0) -> int:
    return (round(time * SAMPLE_RATE) + offset) % INDICES


def level_frame(name: str, level: int, time: float, index: int | None = None) -> TimedFrame:
    """A level and, where the message has one, the index [samples] at which it came, sent at a time [s]."""
    values = {"Energized": level} | ({} if index is None else {"PulseIndex": index})
    return encoded(BED.get_message_by_name(name), values, time, scaling=False)


def on_change(pulses: Pulses, offset: int = 0) -> list[TimedFrame]:
    return [
        level_frame("PulseLevel", level, time, index_at(time, offset))
        for start, duration in pulses
        for time, level in ((start, 1), (start + duration, 0))
    ]


def duration_frame(duration: float, time: float, index: int) -> TimedFrame:
    return encoded(BED.get_message_by_name("PulseTime"), {"Duration": duration / 1e-6, "PulseIndex": index}, time)


def durations(pulses: Pulses) -> list[TimedFrame]:
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
    times = (phase + 1e-3 * np.arange(int((end - phase) / 1e-3))).tolist()
    return [level_frame("PulseCyclic", int(is_on(pulses, time)), time) for time in times]


def blocks(pulses: Pulses, begin: float, end: float) -> list[TimedFrame]:
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
    for counter, block in enumerate(block for span in spans for block in blocks(pulses, *span)):
        values = plain.decode_simple(block.payload)
        renamed = {f"Safe{name.replace('Sample', '')}": value for name, value in values.items()}
        sent.append(protected(encoded(message, renamed, block.time), DATA_ID, counter))
    return sent


SOURCES: dict[str, tuple[str, Callable[[Pulses], list[TimedFrame]]]] = {
    "level": (EnergizingBy.LEVEL, on_change),
    "duration": (EnergizingBy.TIME, durations),
    "block": (EnergizingBy.LEVELS_IN_BLOCK, lambda pulses: blocks(pulses, 0.0, 0.3)),
    "by stamp": (EnergizingBy.TIME_BY_STAMP, durations),
    "protected": (EnergizingBy.SAFE, safe_durations),
    "cyclic": (EnergizingBy.CYCLIC, lambda pulses: cyclic(pulses, 0.3)),
}
"""Ways to tell of pulses: lines of [signals.energizing], and the frames."""


def watch(bench: Path, sent: Recording | Iterable[TimedFrame], *optional: Iterable[TimedFrame]) -> Result:
    """Samples of a recording, or as frames, and optional frames, by time, through a core that does not learn."""
    return run(bench, merged(samples(sent) if isinstance(sent, Recording) else sent, *optional), learning=False)


def misfired(recording: Recording, *spans: tuple[float, float]) -> Recording:
    """The needle stays shut in spans of time [s]; its sensor is as noisy as ever, or it would be a dropout."""
    lift = recording.needle_lift.copy()
    shut = np.random.default_rng(1).normal(size=lift.size) * SimulatedNoise().needle_lift
    for begin, end in spans:
        span = slice(round(begin * SAMPLE_RATE), round(end * SAMPLE_RATE))
        lift[span] = shut[span]
    return replace(recording, needle_lift=lift)
