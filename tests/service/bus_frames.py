"""Benches with a bus for each signal, and their frames in other orders than those of time."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.recording.replay.framing import Framer, TimedFrame, whole
from observer_rt.recording.signals.recording import Recording
from observer_rt.service.core.core import Core
from observer_rt.service.core.messages import OutputFrame
from tests.service.participants import SAMPLE_RATE

AMPLIFIER_SAMPLES = 28
MESSAGES = {
    "rail_pressure": ("RailPressureBlock", "RailPressure"),
    "needle_lift": ("NeedleLiftBlock", "NeedleLift"),
    "line_pressure": ("LinePressureBlock", "LinePressure"),
}
NAMES = ("", "lift", "line")  # of the buses of the signals


def amplifier_database() -> str:
    """One message of 28 samples, with index, counter and CRC: the same for every amplifier of this kind."""
    lines = [
        'VERSION ""',
        "BU_: Amplifier",
        "BO_ 291 Samples: 64 Amplifier",
        ' SG_ CRC : 0|16@1+ (1,0) [0|0] "" Amplifier',
        ' SG_ Counter : 16|8@1+ (1,0) [0|0] "" Amplifier',
        ' SG_ SampleIndex : 32|32@1+ (1,0) [0|0] "" Amplifier',
    ]
    lines += [
        f' SG_ S{k} : {64 + 16 * k}|16@1+ (0.005,-10) [0|0] "" Amplifier' for k in range(AMPLIFIER_SAMPLES)
    ]
    kinds = ",".join(f'"{n}"' for n in range(14))
    lines += [
        f'BA_DEF_ BO_ "VFrameFormat" ENUM {kinds},"StandardCAN_FD","ExtendedCAN_FD";',
        'BA_DEF_ BO_ "E2EProfile" INT 0 22;',
        'BA_DEF_ BO_ "E2EDataId" INT 0 65535;',
        'BA_DEF_DEF_ "VFrameFormat" "0";',
        'BA_DEF_DEF_ "E2EProfile" 0;',
        'BA_DEF_DEF_ "E2EDataId" 0;',
        'BA_ "VFrameFormat" BO_ 291 14;',
        'BA_ "E2EProfile" BO_ 291 5;',
        'BA_ "E2EDataId" BO_ 291 7;',
    ]
    return "\n".join(lines) + "\n"


def twin_bench(folder: Path) -> Path:
    """Three amplifiers of one kind on three buses: same database, message, identifier and E2E data id."""
    (folder / "amplifier.dbc").write_text(amplifier_database())
    units = {"rail_pressure": "MPa", "needle_lift": "um", "line_pressure": "MPa"}
    signals = "".join(
        f'[signals.{role}]\nmessage = "Samples"\npattern = "S{{}}"\nunit = "{unit}"\n'
        + (f'link = "{name}"\n' if name else "")
        for (role, unit), name in zip(units.items(), NAMES, strict=True)
    )
    return _written(folder, signals, '[[dbc]]\nfile = "amplifier.dbc"\n')


def block_bench(folder: Path, interface: str, channels: Sequence[str]) -> Path:
    """Our own three blocks: on one channel, or each on its own, with the results on a fourth."""
    is_one = len(channels) == 1
    signals = "".join(
        f'[signals.{role}]\nmessage = "{message}"\npattern = "{pattern}_{{:02d}}"\n'
        + (f'link = "{name}"\n' if name and not is_one else "")
        for (role, (message, pattern)), name in zip(MESSAGES.items(), NAMES, strict=True)
    )
    links = f'[link]\ninterface = "{interface}"\nchannel = "{channels[0]}"\n'
    links += "".join(
        f'[links.{name}]\nchannel = "{channel}"\n'
        for name, channel in zip((*NAMES[1:], "results"), channels[1:], strict=not is_one)
    )
    return _written(folder, links + signals + ("" if is_one else '[outputs]\nlink = "results"\n'), "")


def _written(folder: Path, text: str, dbc: str) -> Path:
    folder.mkdir(exist_ok=True)
    links = "" if "[link]" in text else '[links.lift]\nchannel = "can1"\n[links.line]\nchannel = "can2"\n'
    path = folder / "bench.toml"
    path.write_text(
        f'{links}{dbc}[[dbc]]\nfile = "observer_fd.dbc"\n{text}[sampling]\nrate_hz = {SAMPLE_RATE}\n'
        "[learning]\nlockstep = true\n"
    )
    return path


def frames_of(bench: Path, recording: Recording) -> list[TimedFrame]:
    """The frames of a recording in order of time."""
    return list(Framer(map_bus(load_bench(bench))).frames(recording, whole(recording)))


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


def through_core(bench: Path, frames: Sequence[TimedFrame]) -> tuple[list[OutputFrame], Core]:
    """The frames through a fresh core, to the end; what it answers."""
    loaded = load_bench(bench)
    core = Core(loaded.injector, map_bus(loaded))
    out: list[OutputFrame] = []
    for frame in frames:
        out += core.handle(frame.frame_id, frame.is_extended, frame.payload, frame.stamp_ns, frame.bus)
    return out + core.finish(), core
