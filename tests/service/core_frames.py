"""Frames as any measuring device would send them, by plain cantools and autosar-e2e; and results read back so."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import cantools
import e2e.p05
import numpy as np
from cantools.database.can import Database, Message

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import PACKAGE_DATA, load_bench, load_injector
from observer_rt.model.effects import sized
from observer_rt.observer.learning.knowledge import Knowledge
from observer_rt.recording.signals.recording import Recording
from observer_rt.service.core.core import Core
from observer_rt.service.core.messages import OutputFrame
from observer_rt.service.reports.injection_report import InjectionReport
from observer_rt.service.reports.news import Notes
from observer_rt.simulation.measurement import NoiseLevels
from observer_rt.simulation.schedule import make_schedule
from observer_rt.simulation.simulate import simulate

DATABASE: Database = cantools.database.load_file(PACKAGE_DATA / "observer_fd.dbc")
NOT_AVAILABLE = 0xFFFF
SAMPLE_RATE = 50e3
RATES = 28  # in a frame

ONE_MESSAGE = {"rail_pressure": "SampleBlock", "needle_lift": "SampleBlock", "line_pressure": "SampleBlock"}
THREE_MESSAGES = {
    "rail_pressure": "RailPressureBlock",
    "needle_lift": "NeedleLiftBlock",
    "line_pressure": "LinePressureBlock",
}
PATTERNS = {"rail_pressure": "RailPressure", "needle_lift": "NeedleLift", "line_pressure": "LinePressure"}
UNITS = {"rail_pressure": 1e6, "needle_lift": 1e-6, "line_pressure": 1e6}


@dataclass(frozen=True)
class Frame:
    """One received frame."""

    frame_id: int
    payload: bytes
    stamp_ns: int = 0


def bench_text(messages: dict[str, str], extra: str = "", dbc: str = "observer_fd.dbc") -> str:
    """A bench file at SAMPLE_RATE with these messages for the roles."""
    signals = "".join(
        f'[signals.{role}]\nmessage = "{message}"\npattern = "{PATTERNS[role]}_{{:02d}}"\n'
        for role, message in messages.items()
    )
    return f'[[dbc]]\nfile = "{dbc}"\n{signals}[sampling]\nrate_hz = {SAMPLE_RATE}\n{extra}'


@dataclass
class Device:
    """Sends a recording in blocks; its counters and its index go on from call to call."""

    messages: dict[str, str]
    index: int = 0
    _counters: dict[str, int] = field(default_factory=dict)

    def send(self, recording: Recording, start: int = 0, end: int | None = None) -> list[Frame]:
        """Whole blocks of samples [start, end), message by message in order of their last sample."""
        end = recording.samples if end is None else end
        frames = []
        for name in dict.fromkeys(self.messages.values()):
            message = DATABASE.get_message_by_name(name)
            roles = [role for role, of in self.messages.items() if of == name]
            size = sum(s.name.startswith(PATTERNS[roles[0]]) for s in message.signals)
            for first in range(start, end - size + 1, size):
                frames.append((first + size, self._frame(message, roles, recording, first, size)))
        return [frame for _, frame in sorted(frames, key=lambda item: item[0])]

    def _frame(
        self, message: Message, roles: Sequence[str], recording: Recording, first: int, size: int
    ) -> Frame:
        values = {signal.name: 0.0 for signal in message.signals}
        values |= {s.name: s.minimum for s in message.signals if s.name == "FuelTemperature"}
        values["SampleIndex"] = (self.index + first) % (1 << 32)
        for role in roles:
            samples = getattr(recording, role)[first : first + size] / UNITS[role]
            values |= {f"{PATTERNS[role]}_{k:02d}": float(v) for k, v in enumerate(samples)}
        payload = bytearray(message.encode(values, strict=True))
        counter = self._counters.get(message.name, 0)
        self._counters[message.name] = (counter + 1) % 256
        return Frame(message.frame_id, protected(payload, message.frame_id, counter))


def protected(payload: bytearray, data_id: int, counter: int) -> bytes:
    """The payload with counter and CRC; in our database the data id is the frame's id."""
    payload[2] = counter
    e2e.p05.e2e_p05_protect(payload, data_id, length=len(payload), increment_counter=False)
    return bytes(payload)


@dataclass(frozen=True)
class Result:
    """What a core made of frames."""

    core: Core
    frames: list[OutputFrame]
    reports: list[InjectionReport]

    @property
    def rate_frames(self) -> Iterator[tuple[int, dict[str, int], list[int]]]:
        """First index, header and raw codes of every `InjectionRate` frame, its protection checked."""
        message = DATABASE.get_message_by_name("InjectionRate")
        counter = 0
        for frame in self.frames:
            if frame.frame_id != message.frame_id:
                continue
            assert e2e.p05.e2e_p05_check(frame.payload, message.frame_id, length=64)
            header = message.decode(frame.payload, scaling=False, decode_choices=False)
            assert header["Counter"] == counter
            counter = (counter + 1) % 256
            yield header["SampleIndex"], header, [header[f"InjectionRate_{k:02d}"] for k in range(RATES)]

    @property
    def rates(self) -> dict[int, int]:
        """Raw code by sample index, not available left out; every index at most once."""
        codes: dict[int, int] = {}
        for first, _, values in self.rate_frames:
            for k, code in enumerate(values):
                if code != NOT_AVAILABLE:
                    assert first + k not in codes, f"index {first + k} is published twice"
                    codes[first + k] = code
        return codes

    @property
    def covered(self) -> list[int]:
        """Indices the frames speak of, available or not."""
        return [first + k for first, _, _ in self.rate_frames for k in range(RATES)]

    @property
    def summaries(self) -> list[dict[str, float]]:
        """`InjectionSummary` frames, decoded, their protection checked."""
        message = DATABASE.get_message_by_name("InjectionSummary")
        found = [frame for frame in self.frames if frame.frame_id == message.frame_id]
        assert all(e2e.p05.e2e_p05_check(f.payload, message.frame_id, length=48) for f in found)
        return [message.decode(frame.payload, decode_choices=False) for frame in found]


def run(bench: Path, frames: Iterable[Frame], knowledge: Knowledge | None = None) -> Result:
    """Frames through a fresh core in lockstep, to the end."""
    loaded = load_bench(bench)
    notes = Notes()
    core = Core(loaded.injector, map_bus(loaded), knowledge, listeners=[notes])
    out: list[OutputFrame] = []
    for frame in frames:
        out += core.handle(frame.frame_id, False, frame.payload, frame.stamp_ns)
    return Result(core, out + core.finish(), notes.injections)


@cache
def recording() -> Recording:
    """Three injections of an injector worn by 20 %, with noise: 0.3 s, 15,000 samples."""
    schedule = make_schedule([100e6], 3, 0.05, [1.1e-3])
    effects = (sized("orifice_area", v_H=0.2),)
    return simulate(load_injector(), schedule, SAMPLE_RATE, effects, NoiseLevels(), seed=8).recording


def damaged(frame: Frame, bit: int) -> Frame:
    """The frame with one bit flipped."""
    payload = np.frombuffer(frame.payload, np.uint8).copy()
    payload[bit // 8] ^= 1 << (bit % 8)
    return Frame(frame.frame_id, payload.tobytes())
