"""Our daemon on a socket pair that carries raw frames, no bus, no other kernel: how much it takes without a loss, how
soon it is ready, and for as long as one likes with its Python disturbed: what grows, what is lost?
"""

import socket
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from tests.plants.arrays import Array
from tools.benchmarks.report import list_of
from tools.benchmarks.speed.observers import PAUSED_RUN, RUN, Observer, observer
from tools.benchmarks.speed.pace import Latency, latency_of, socket_pacer
from tools.benchmarks.speed.traffic import (
    RATES,
    SAMPLE_RATE,
    SAMPLES,
    Ids,
    Traffic,
    make_traffic,
    write_bench,
)

BUFFER_BYTES = 16 << 20  # as the daemon asks of a CAN socket
STARTS = 3
STRETCH = 10.0  # s of a soak
SETTLED = 0.2  # of the soak, after which nothing should grow any more
FEWEST = 10  # stretches a line is put through
_MEBIBYTE = 1 << 20


@dataclass(frozen=True)
class Pair:
    """Two connected sockets that keep frames apart."""

    sender: socket.socket
    receiver: socket.socket


@dataclass(frozen=True)
class Sustained:
    """What came of so many seconds at a rate.

    cpu_share: of one core, all threads of the daemon; thread_shares: the same of each, the busiest first.
    """

    seconds: float
    sustained_khz: float
    cpu_share: float
    thread_shares: tuple[float, ...]
    lost_samples: int
    given_up_frames: int
    latency: Latency
    memory_mib: float
    farewell: str
    latencies: Array

    def document(self) -> dict[str, Any]:
        """For JSON."""
        fields = asdict(self)
        del fields["latencies"]
        return fields


def socket_pair(stack: ExitStack) -> Pair:
    """A pair with room for as many frames as the kernel allows."""
    sender, receiver = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for each in (sender, receiver):
        stack.enter_context(each)
        each.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
    return Pair(sender, receiver)


@contextmanager
def daemon_on_sockets(
    folder: Path, command: Sequence[str] = RUN, *changes: tuple[str, str]
) -> Iterator[tuple[Observer, socket.socket]]:
    """A daemon that is ready, and the socket to send to it by; its bench file, with changes, goes into the folder."""
    with ExitStack() as stack:
        pair = socket_pair(stack)
        descriptor = pair.receiver.fileno()
        bench = write_bench(folder, "descriptor", str(descriptor), Ids(), *changes)
        yield stack.enter_context(observer([*command, bench], [descriptor])), pair.sender


def measure_sustained(folder: Path, traffic: Traffic, seconds: float, rate: float = SAMPLE_RATE) -> Sustained:
    """Send samples at `rate` [Hz] for so long."""
    with daemon_on_sockets(folder / "sustained") as (ours, sender):
        pacer = socket_pacer(folder, traffic, sender)
        period = SAMPLES / rate
        pacer.send(round(1.0 / period), period)  # meets what is met for the first time
        before, by_thread = ours.cpu_time(), ours.cpu_time_by_thread()
        passage = pacer.send(round(seconds / period), period)
        share = (ours.cpu_time() - before) / passage.seconds
        spent = {name: now - by_thread.get(name, 0.0) for name, now in ours.cpu_time_by_thread().items()}
        shares = sorted((each / passage.seconds for each in spent.values()), reverse=True)
        memory = ours.memory()
    told = passage.index.size * RATES
    latencies = passage.latencies(traffic, open_only=False)
    return Sustained(
        seconds,
        told / passage.seconds / 1e3,
        share,
        tuple(shares),
        passage.lost(traffic),
        int(np.sum(passage.sent == 0)),
        latency_of(latencies),
        memory / _MEBIBYTE,
        farewell(ours),
        latencies,
    )


def farewell(ours: Observer) -> str:
    """What our daemon counted, by its last words."""
    return next((line for line in reversed(ours.said) if "stopped after" in line), "")


@dataclass(frozen=True)
class Startup:
    """Seconds, the fastest of some starts; imports_s: until its first word; cpu_s: of the processor, all threads."""

    ready_s: float
    imports_s: float
    cpu_s: float
    memory_mib: float


@dataclass(frozen=True)
class _Start:
    ready_s: float
    imports_s: float
    cpu_s: float
    memory: int


def measure_startup(folder: Path) -> Startup:
    """Start it a few times."""
    best = min((_start(folder) for _ in range(STARTS)), key=lambda each: each.ready_s)
    return Startup(best.ready_s, best.imports_s, best.cpu_s, best.memory / _MEBIBYTE)


def _start(folder: Path) -> _Start:
    with daemon_on_sockets(folder / "startup") as (started, _):
        return _Start(started.ready_after, started.spoke_after, started.cpu_time(), started.memory())


@dataclass(frozen=True)
class Stretch:
    """Some seconds of the soak. sent, told: samples in, and samples in rate frames."""

    minute: float
    sent: int
    told: int
    lost: int
    repeated: int
    latency: Latency
    cpu_share: float
    memory_mib: float
    threads: int
    descriptors: int


@dataclass(frozen=True)
class Soak:
    """All of it; farewell: what the daemon counted itself."""

    stretches: tuple[Stretch, ...]
    farewell: str

    @property
    def lost(self) -> int:
        """Samples of which no rate frame told."""
        return sum(each.lost for each in self.stretches)

    @property
    def repeated(self) -> int:
        """Samples told of more than once."""
        return sum(each.repeated for each in self.stretches)

    @property
    def growth_mib_an_hour(self) -> float:
        """Of the memory, by a straight line through it once it has settled; nan of too few stretches."""
        settled = self.stretches[int(SETTLED * len(self.stretches)) :]
        if len(settled) < FEWEST:
            return float("nan")
        hours = [each.minute / 60.0 for each in settled]
        return float(np.polyfit(hours, [each.memory_mib for each in settled], 1)[0])

    def document(self) -> dict[str, Any]:
        """For JSON."""
        last, settled = self.stretches[-1], self.stretches[int(SETTLED * len(self.stretches))]
        return {
            "figures": {
                "minutes": last.minute,
                "sent_samples": sum(each.sent for each in self.stretches),
                "lost_samples": self.lost,
                "repeated_samples": self.repeated,
                "memory_growth_mib_per_h": self.growth_mib_an_hour,
                "threads_grown": last.threads - settled.threads,
                "descriptors_grown": last.descriptors - settled.descriptors,
                "p999_us_max": max(each.latency.p999 for each in self.stretches),
            },
            "details": {"stretches": [asdict(each) for each in self.stretches], "farewell": self.farewell},
        }


def run_soak(folder: Path, minutes: float) -> Soak:
    """Stretch after stretch to one daemon that learns, until the time is over. Raises RunError."""
    traffic = make_traffic(folder)
    found: list[Stretch] = []
    with daemon_on_sockets(folder / "soak", PAUSED_RUN) as (ours, sender):
        pacer = socket_pacer(folder, traffic, sender)
        frames = round(STRETCH * SAMPLE_RATE / SAMPLES)
        for number in range(max(1, round(minutes * 60.0 / STRETCH))):
            before = ours.cpu_time()
            passage = pacer.send(frames, SAMPLES / SAMPLE_RATE)
            found.append(
                Stretch(
                    (number + 1) * STRETCH / 60.0,
                    frames * SAMPLES,
                    passage.index.size * RATES,
                    passage.lost(traffic),
                    passage.repeated,
                    latency_of(passage.latencies(traffic, open_only=False)),
                    (ours.cpu_time() - before) / passage.seconds,
                    ours.memory() / _MEBIBYTE,
                    ours.resources.num_threads(),
                    ours.resources.num_fds(),
                )
            )
    return Soak(tuple(found), farewell(ours))


def soak_table(soak: Soak, rows: int = 20) -> Table:
    """Some stretches, evenly spaced, and what came of all."""
    grown = soak.growth_mib_an_hour
    counted = f"{soak.lost} samples lost, {soak.repeated} told twice"
    title = f"{counted}; memory grows by {grown:.2f} MiB an hour once settled"
    columns = {
        "minute": "{.minute:.1f}",
        "samples in": "{.sent}",
        "told": "{.told}",
        "lost": "{.lost}",
        "p50 / p99 / p99.9": "{.latency}",
        "CPU": "{.cpu_share:.2f}",
        "MiB": "{.memory_mib:.1f}",
        "threads": "{.threads}",
        "files": "{.descriptors}",
    }
    places = np.unique(np.linspace(0, len(soak.stretches) - 1, rows).round().astype(int))
    return list_of(title, [[soak.stretches[place] for place in places]], columns)
