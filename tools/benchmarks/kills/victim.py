"""The daemon that is killed: `serve` as `observer-rt run` calls it, with a bench of its own beside it."""

import contextlib
import io
import os
import random
import resource
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TextIO, cast

from rich.console import Console

from observer_rt.bus.links.opening import open_link
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench, load_bench
from observer_rt.config.bench_file import LinkConfig
from observer_rt.config.injector import LearningConfig, SamplingConfig, StateConfig
from observer_rt.daemon.options import RunOptions
from observer_rt.daemon.run import serve
from observer_rt.desk.simulation.schedule import make_schedule
from observer_rt.files.replay.framing import Framer, TimedFrame, whole
from observer_rt.files.replay.player import play
from observer_rt.foundation.console import say
from tools.benchmarks.scoring import worn_injector

SAMPLE_RATE = 50e3  # Hz
SPEED = 2.0  # of the replay: 40 injections a second
INJECTIONS = 20  # of the recording, which is played again and again
FULL, FREE = "campaign: the disk is full", "campaign: the disk has room"
FILLER = "filler"  # file that takes all the room there is
SMALL_FILE = 512  # bytes, less than either file needs


@dataclass(frozen=True)
class Scene:
    """What every daemon of a campaign runs on."""

    bench: Bench
    frames: Sequence[TimedFrame]
    state: Path
    journal: Path


@dataclass(frozen=True)
class FullDisk:
    """When the disk has no room, in seconds from the daemon's start; small: the folder's disk is really filled."""

    start: float
    end: float
    small: bool


def make_scene(folder: Path, interface: str, channel: str, within: float) -> Scene:
    """A bench in lockstep that saves within so many seconds, compiled, and a worn injector's frames for it."""
    bench = load_bench().with_sections(
        sampling=SamplingConfig(rate_hz=SAMPLE_RATE),
        learning=LearningConfig(lockstep=True),
        state=StateConfig(save_within_s=within),
    )
    link = LinkConfig(interface=interface, channel=channel)
    bench = replace(bench, config=bench.config.model_copy(update={"link": link}))
    schedule = make_schedule([60e6, 120e6], INJECTIONS, 0.05, [1.1e-3])
    recording = worn_injector(schedule, SAMPLE_RATE, wear=0.3, seed=3).recording
    bus = map_bus(bench)
    frames = list(Framer(bus).frames(recording, whole(recording)))
    return Scene(bench, frames, folder / "state.json", folder / "injections.sqlite")


def run_victim(scene: Scene, messages: int, full: FullDisk | None) -> None:
    """Serve until killed; messages: descriptor for what the daemon says. To be called in a process of its own."""
    with os.fdopen(messages, "w") as file:
        console = Console(file=cast(TextIO, _Stamped(file)), width=200)
        threading.Thread(target=partial(_play, scene), daemon=True).start()
        if full is not None:
            threading.Thread(target=partial(_fill, scene, full, console), daemon=True).start()
        serve(scene.bench, RunOptions(state=scene.state, journal=scene.journal), console, lambda: scene.bench)


class _Stamped(io.TextIOBase):
    """Writes every line with the time it is written at, s of the monotonic clock, which all processes share."""

    def __init__(self, file: TextIO) -> None:
        self._file = file
        self._rest = ""

    def write(self, text: str) -> int:
        *lines, self._rest = (self._rest + text).split("\n")
        for line in lines:
            self._file.write(f"{time.monotonic():.6f} {line}\n")
        self._file.flush()
        return len(text)


def _play(scene: Scene) -> None:
    link = scene.bench.config.link
    with open_link(link.interface, link.channel, True, []) as player:
        while True:
            play(scene.frames, player, SPEED)


def _fill(scene: Scene, full: FullDisk, console: Console) -> None:
    time.sleep(full.start)
    with _filled(scene.state.parent) if full.small else _limited():
        say(console, FULL)
        time.sleep(full.end - full.start)
    say(console, FREE)


@contextlib.contextmanager
def _limited() -> Iterator[None]:
    """No file of this process may grow beyond a few bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (SMALL_FILE, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@contextlib.contextmanager
def _filled(folder: Path) -> Iterator[None]:
    """A small disk to its last byte."""
    filler = folder / FILLER
    with filler.open("wb", buffering=0) as file, contextlib.suppress(OSError):
        while True:
            file.write(random.randbytes(4096))
    try:
        yield
    finally:
        filler.unlink()
