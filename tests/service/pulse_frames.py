"""A pulse generator that tells when it energizes the injector: its database, and its frames by plain cantools."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cantools
import numpy as np
from cantools.database.can import Database

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
from tests.service.core_frames import ONE_MESSAGE, SAMPLE_RATE, Device, Frame, bench_text, protected

BLOCK = 9  # samples in a frame of the measuring device
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
 SG_ UncommandedInjections : 16|16@1+ (1,0) [0|65535] "" Bed
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
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","a","b","c","d","e","f","g","h","i","j","k","l","FD";
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_ BO_ "E2EProfile" INT 0 255;
BA_DEF_ BO_ "E2EDataId" INT 0 65535;
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_DEF_DEF_ "E2EProfile" 0;
BA_DEF_DEF_ "E2EDataId" 0;
BA_ "VFrameFormat" BO_ 818 14;
BA_ "VFrameFormat" BO_ {SAFE_BLOCK_ID} 14;
BA_ "E2EProfile" BO_ {SAFE_BLOCK_ID} 5;
BA_ "E2EDataId" BO_ {SAFE_BLOCK_ID} {DATA_ID};
BA_ "GenMsgCycleTime" BO_ 819 1;
BA_ "E2EProfile" BO_ {SAFE_ID} 5;
BA_ "E2EDataId" BO_ {SAFE_ID} {DATA_ID};
VAL_ 816 Energized 3 "SNA" ;
VAL_ 822 Level 3 "SNA" ;
"""
BED: Database = cantools.database.load_string(TEXT, "dbc")

LEVEL = 'message = "PulseLevel"\nsignal = "Energized"\nindex = "PulseIndex"\n'
TIME = 'message = "PulseTime"\nsignal = "Duration"\nindex = "PulseIndex"\n'
TIME_BY_STAMP = 'message = "PulseTime"\nsignal = "Duration"\n'
LEVELS_IN_BLOCK = 'message = "PulseBlock"\npattern = "Level_{:02d}"\n'
SAFE_BLOCK = 'message = "PulseSafeBlock"\npattern = "SafeLevel_{:02d}"\nindex = "SafeIndex"\n'
CYCLIC = 'message = "PulseCyclic"\nsignal = "Energized"\n'
SAFE = 'message = "PulseSafe"\nsignal = "Duration"\n'

EPOCH = 1_700_000_000_000_000_000  # ns, of the receiver's clock


@dataclass(frozen=True)
class Sent:
    """A frame, and when it comes [s]; its stamp is that, unless it is late."""

    time: float
    frame: Frame


def pulse_bench(folder: Path, energizing: str, extra: str = "") -> Path:
    """A bench with the lines of [signals.energizing], on a bus where frames take no time."""
    (folder / "bed.dbc").write_text(TEXT)
    path = folder / "bench.toml"
    link = f'[link]\ninterface = "virtual"\nchannel = "{folder.name}"\n'
    lines = f'{extra}\n[[dbc]]\nfile = "bed.dbc"\n[signals.energizing]\n{energizing}'
    path.write_text(link + bench_text(ONE_MESSAGE, lines))
    return path


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
    """The needle stays shut in spans of time [s]."""
    lift = recording.needle_lift.copy()
    for begin, end in spans:
        lift[round(begin * SAMPLE_RATE) : round(end * SAMPLE_RATE)] = 0.0
    return replace(recording, needle_lift=lift)
