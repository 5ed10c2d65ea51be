"""Faults of a running daemon on a real SocketCAN bus: the process stopped, the interface away, another sender."""

import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from observer_rt.bus.links.link import Link, LinkDownError
from observer_rt.bus.links.opening import open_link
from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import load_bench
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.files.replay.framing import Framer, TimedFrame, all_samples
from observer_rt.files.replay.player import play
from observer_rt.foundation.errors import RunError
from tests.meanwhile import meanwhile
from tests.observed_plants import recording_of
from tests.plants.parameters import Faults, Injector
from tests.plants.plant import Outcome, record
from tools.benchmarks.campaign import Row, messages
from tools.benchmarks.faults import reasons as of
from tools.benchmarks.faults.fault import Fault, PlacedFault, Where
from tools.benchmarks.faults.player import RATE_ID, SUMMARY_ID, Receiver, Results
from tools.benchmarks.faults.scenario import AT, Scenario, Task, drawn
from tools.benchmarks.faults.score import facts_of
from tools.benchmarks.scoring import bench_text
from tools.benchmarks.speed.observers import RUN, Observer, observer
from tools.benchmarks.speed.traffic import index_of

CHANNEL = "vcan0"
WEAR = 0.2  # v_H: one injector for all
REST = 0.5  # s without a frame after which a scenario is over
BUSY_ID, BUSY_FRAMES = 0x555, 2000.0  # 1/s


@dataclass(frozen=True)
class Bus:
    """The daemon and the bus it is on; link: of the measuring device."""

    daemon: Observer
    link: Link


@contextmanager
def _between(begin: Callable[[], None], end: Callable[[], None]) -> Iterator[None]:
    begin()
    try:
        yield
    finally:
        end()


def _send(frame_id: int, rate: float, over: threading.Event) -> None:
    """Another node's frames [1/s] on the bus."""
    rng = np.random.default_rng(1)
    with open_link("socketcan", CHANNEL, True, []) as link:
        while not over.wait(1.0 / rate):
            link.send(frame_id, rng.bytes(64), False, True)


_LIVE: dict[str, Callable[[Bus], AbstractContextManager[None]]] = {
    "process_stopped": lambda bus: _between(
        bus.daemon.suspend, partial(bus.daemon.process.send_signal, signal.SIGCONT)
    ),
    "interface_away": lambda bus: _between(partial(_set, "down"), partial(_set, "up")),
    "second_sender": lambda bus: meanwhile(partial(_send, RATE_ID, 20.0)),
    "busy_bus": lambda bus: meanwhile(partial(_send, BUSY_ID, BUSY_FRAMES)),
}
ROWS = {
    name: Fault(name, Where.PROCESS, of.AWAY | ({"SECOND_SENDER"} if name == "second_sender" else set()))
    for name in _LIVE
}


def run_live(count: int, master_seed: int, folder: Path) -> list[Row]:
    """So many scenarios one after the other on one daemon. Raises RunError where it does not start."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "bench.toml"
    path.write_text(bench_text(('channel = "can0"', f'channel = "{CHANNEL}"')), "utf-8")
    framer, rows = Framer(map_bus(load_bench(path))), []
    names = [f"{name}{AT}0" for name in ROWS]
    with (
        observer([*RUN, path]) as daemon,
        open_link("socketcan", CHANNEL, True, []) as device,
        open_link("socketcan", CHANNEL, True, [(RATE_ID, False), (SUMMARY_ID, False)]) as ear,
    ):
        for number in range(count):
            messages.print(f"live: {number + 1} of {count}")
            scenario = drawn(Task(names[number % len(names)], master_seed, number), ROWS, is_rich=False)
            events = tuple(replace(event, faults=Faults(orifice_area=WEAR)) for event in scenario.bench.events)
            scenario = replace(scenario, bench=replace(scenario.bench, injector=Injector(), events=events))
            outcome = record(scenario.bench)
            recording = recording_of(outcome)
            frames = list(framer.frames(recording, all_samples(recording)))
            published = _played(scenario, outcome, frames, Bus(daemon, device), ear)
            rows.append(facts_of(scenario, outcome, published))
            if daemon.process.poll() is not None:
                rows[-1] |= {"crash": "\n".join(daemon.said[-5:]), "crashed": True}
                break
    return rows


def _played(scenario: Scenario, outcome: Outcome, frames: list[TimedFrame], bus: Bus, ear: Link) -> Results:
    """What the daemon publishes while the frames are sent in real time, and the fault comes and goes."""
    receiver = Receiver(outcome.measured.time)
    for moment in outcome.measured.time[[0, -1]]:  # numbered on from the scenario before
        receiver.note_sent(moment, index_of(frames[0].payload))
    [placed] = scenario.placed
    begun = time.monotonic()
    threads = [
        threading.Thread(target=partial(play, frames, bus.link, 1.0)),
        threading.Thread(target=partial(_misbehave, placed, bus, begun)),
    ]
    for thread in threads:
        thread.start()
    end = begun + frames[-1].time + REST
    while time.monotonic() < end or any(thread.is_alive() for thread in threads):  # The daemon may lag if busy.
        try:
            frame = ear.receive(0.05)
        except RunError:  # away; where it is not back yet, the link stays closed
            time.sleep(0.01)
            with suppress(LinkDownError):
                ear.reconnect()
            continue
        if frame is not None:
            end = max(end, time.monotonic() + REST)
            receiver.take([OutputFrame(frame.frame_id, False, True, frame.payload)])
    return receiver.published


def _misbehave(placed: PlacedFault, bus: Bus, begun: float) -> None:
    time.sleep(max(begun + placed.begin - time.monotonic(), 0.0))
    with _LIVE[placed.fault.name](bus):
        time.sleep(placed.end - placed.begin)


def _set(state: str) -> None:
    environment = os.environ | {"PATH": f"{os.environ['PATH']}:/usr/sbin:/sbin"}
    subprocess.run(["ip", "link", "set", CHANNEL, state], check=True, env=environment)
