"""The traffic: one recording as frames, again and again, and the bench file that takes them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import PACKAGE_DATA
from observer_rt.desk.simulation.schedule import Event, Schedule, Shot
from observer_rt.engine.service.core import Core
from observer_rt.files.replay.framing import Framer, all_samples
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import MILLISECOND
from tests.observed_plants import bench_at
from tools.benchmarks.scoring import bench_text, worn_injector

SAMPLE_RATE = 100e3  # Hz
SAMPLES, RATES = 9, 28  # of an input frame and of a rate frame
INPUT_ID, RATE_ID, DATA_ID = 0x100, 0x200, 0x100
PERIOD = 40 * MILLISECOND  # 25 injections a second
_ENERGIZING, _FIRST = 1.2 * MILLISECOND, 10 * MILLISECOND
_EVENTS = 9  # 0.36 s, a whole number of frames
_PRESSURES = (60e6, 100e6, 140e6)  # Pa
_OPEN = 5e-6  # m
RAW_FRAME = np.dtype([("id", "<u4"), ("length", "u1"), ("flags", "u1"), ("unused", "<u2"), ("data", "u1", 64)])
_SWITCHED = 1  # flag of struct canfd_frame
DEFAULT_IDS = (256, 272, 273, 274, 512, 513, 514)
_ID_STEP = 32
_ENOUGH_FRAMES = 200  # a rate frame ends at every place of an input frame


@dataclass(frozen=True)
class Traffic:
    """A loop of input frames. ahead: samples that are known beyond a rate frame's last one when it is sent."""

    loop: Path
    frames: int
    is_open: NDArray[np.bool_]
    """Of every sample of the loop: whether the needle is open."""
    ahead: int

    def trigger(self, index: NDArray[np.int64]) -> NDArray[np.int64]:
        """Number of the input frame that lets a rate frame be sent, by the index that the rate frame begins with."""
        return (index + RATES - 1 + self.ahead) // SAMPLES


class Ids:
    """Identifiers of one of several observers on the same bus; shift: added to the database's."""

    def __init__(self, number: int = 0) -> None:
        self.number, self.shift = number, number * _ID_STEP
        self.input, self.rate = INPUT_ID + self.shift, RATE_ID + self.shift


def worn_loop(injections: int) -> Recording:
    """Injections of a worn injector, a period each, at three pressures one after the other."""
    events = tuple(
        Event(_FIRST + n * PERIOD, _PRESSURES[n * len(_PRESSURES) // injections], (Shot(_ENERGIZING),))
        for n in range(injections)
    )
    return worn_injector(Schedule(events, injections * PERIOD - 1.0 / SAMPLE_RATE), SAMPLE_RATE).recording


def make_traffic(folder: Path) -> Traffic:
    recording = worn_loop(_EVENTS)
    bus = map_bus(bench_at(SAMPLE_RATE))
    payloads = [frame.payload for frame in Framer(bus).frames(recording, all_samples(recording))]
    raw = np.zeros(len(payloads), RAW_FRAME)
    raw["id"], raw["length"], raw["flags"] = INPUT_ID, 64, _SWITCHED
    raw["data"] = np.frombuffer(b"".join(payloads), np.uint8).reshape(-1, 64)
    path = folder / "loop.frames"
    path.write_bytes(raw.tobytes())
    return Traffic(path, len(payloads), recording.needle_lift > _OPEN, samples_ahead(payloads))


def samples_ahead(payloads: Sequence[bytes]) -> int:
    """Samples the core knows beyond a rate frame's last one, at least, when it publishes it."""
    bench = bench_at(SAMPLE_RATE)
    core = Core(bench.injector, map_bus(bench), learning=False)
    ahead = []
    for number, payload in enumerate(payloads[:_ENOUGH_FRAMES]):
        newest = (number + 1) * SAMPLES - 1
        for frame in core.handle(INPUT_ID, False, payload, number):
            if frame.frame_id == RATE_ID:
                ahead.append(newest - (index_of(frame.payload) + RATES - 1))
    return min(ahead)


def index_of(payload: bytes) -> int:
    return int.from_bytes(payload[4:8], "little")


def write_bench(folder: Path, interface: str, channel: str, ids: Ids, *changes: tuple[str, str]) -> Path:
    """The example bench on another channel and under other identifiers, with other changes of its text."""
    folder.mkdir(parents=True, exist_ok=True)
    database = (PACKAGE_DATA / "observer_fd.dbc").read_text("utf-8")
    for number in DEFAULT_IDS:
        mention = rf"^(BO_|CM_ BO_|CM_ SG_|VAL_|SIG_VALTYPE_|BA_ \"\w+\" BO_|BA_ \"\w+\" SG_) {number} "
        database = re.sub(mention, rf"\1 {number + ids.shift} ", database, flags=re.MULTILINE)
    (folder / "observer_fd.dbc").write_text(database, "utf-8")
    text = bench_text(
        ('interface = "socketcan"', f'interface = "{interface}"'),
        ('channel = "can0"', f'channel = "{channel}"'),
        *changes,
    )
    path = folder / "bench.toml"
    path.write_text(text, "utf-8")
    return path
