"""How much our daemon takes without a loss, on a socket pair that carries raw frames: no bus, no other kernel."""

import socket
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tools.benchmarks.speed.observers import RUN, Observer, observer
from tools.benchmarks.speed.pace import Latency, latency_of, socket_pacer
from tools.benchmarks.speed.traffic import RATES, SAMPLE_RATE, SAMPLES, Ids, Traffic, write_bench

BUFFER_BYTES = 16 << 20  # as the daemon asks of a CAN socket
WARM_STARTS = 3


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
    latencies: NDArray[np.float64]

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
    folder: Path, command: Sequence[str] = RUN, environment: dict[str, str] | None = None
) -> Iterator[tuple[Observer, socket.socket]]:
    """A daemon that is ready, and the socket to send to it by; its bench file goes into the folder."""
    with ExitStack() as stack:
        pair = socket_pair(stack)
        descriptor = pair.receiver.fileno()
        bench = write_bench(folder, "descriptor", str(descriptor), Ids())
        yield stack.enter_context(observer([*command, bench], [descriptor], environment)), pair.sender


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
        memory / (1 << 20),
        farewell(ours),
        latencies,
    )


def farewell(ours: Observer) -> str:
    """What our daemon counted, by its last words."""
    return next((line for line in reversed(ours.said) if "stopped after" in line), "")


@dataclass(frozen=True)
class Startup:
    """Seconds, the fastest of some warm starts; cold: with an empty folder of compiled code, None if left out.

    imports_s: of the warm one until it says its first word; cpu_s: processor time of them, all threads.
    """

    warm_s: float
    imports_s: float
    warm_cpu_s: float
    cold_s: float | None
    cold_cpu_s: float | None
    memory_mib: float


@dataclass(frozen=True)
class _Start:
    ready_s: float
    imports_s: float
    cpu_s: float
    memory: int


def measure_startup(folder: Path, *, cold: bool) -> Startup:
    """Start it a few times, and once with nothing compiled."""
    starts = [_start(folder) for _ in range(1 + WARM_STARTS)][1:]  # the first may have to compile
    warm = min(starts, key=lambda each: each.ready_s)
    slow = None
    if cold:
        with tempfile.TemporaryDirectory(dir=folder) as empty:
            slow = _start(folder, {"NUMBA_CACHE_DIR": empty})
    return Startup(
        warm.ready_s,
        warm.imports_s,
        warm.cpu_s,
        slow.ready_s if slow else None,
        slow.cpu_s if slow else None,
        warm.memory / (1 << 20),
    )


def _start(folder: Path, environment: dict[str, str] | None = None) -> _Start:
    with daemon_on_sockets(folder / "startup", environment=environment) as (started, _):
        return _Start(started.ready_after, started.spoke_after, started.cpu_time(), started.memory())
