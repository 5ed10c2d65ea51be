"""Our daemon on a socket pair at 100 kHz: its load, its start, and a soak in which its Python pauses at random."""

import socket
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

from tools.benchmarks.campaign import Row, messages
from tools.benchmarks.speed.observers import PAUSED_RUN, RUN, Observer, observer
from tools.benchmarks.speed.pace import Pacer, latency_of, socket_pacer
from tools.benchmarks.speed.traffic import RATES, SAMPLE_RATE, SAMPLES, Ids, Traffic, make_traffic, write_bench

BUFFER_BYTES = 16 << 20  # as the daemon asks of a CAN socket
STARTS = 3
STRETCH = 10.0  # s of a soak
FRAME = SAMPLES / SAMPLE_RATE  # s
_MEBIBYTE = 1 << 20


def socket_pair(stack: ExitStack) -> tuple[socket.socket, socket.socket]:
    """A connected sender and receiver that keep frames apart, with as large a buffer as the kernel allows."""
    sender, receiver = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in (sender, receiver):
        stack.enter_context(end)
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
    return sender, receiver


@contextmanager
def daemon_on_sockets(folder: Path, command: Sequence[str] = RUN) -> Iterator[tuple[Observer, socket.socket]]:
    """A daemon that is ready, and the socket that sends to it; its bench file goes into the folder."""
    with ExitStack() as stack:
        sender, receiver = socket_pair(stack)
        descriptor = receiver.fileno()
        bench = write_bench(folder, "descriptor", str(descriptor), Ids())
        yield stack.enter_context(observer([*command, bench], [descriptor])), sender


def measure_sustained(folder: Path, traffic: Traffic, seconds: float) -> list[Row]:
    """Send samples at 100 kHz for `seconds`, and measure load, latency and losses."""
    with daemon_on_sockets(folder / "sustained") as (ours, sender):
        pacer = socket_pacer(folder, traffic, sender)
        pacer.send(round(1.0 / FRAME), FRAME)  # so that first-time costs are not measured
        row = _stretch(ours, pacer, traffic, seconds)
    return [{"part": "sustained", "label": "100 kHz, learning", **row}]


def measure_startup(folder: Path) -> list[Row]:
    """Start the daemon a few times: time until it is ready, processor time [s], and memory [MiB]."""
    rows = []
    for number in range(STARTS):
        with daemon_on_sockets(folder / "startup") as (ours, _):
            used = {"cpu_s": ours.cpu_time(), "memory_mib": ours.memory() / _MEBIBYTE}
            rows.append({"part": "startup", "label": f"start {number + 1}", "ready_s": ours.ready_after, **used})
    return rows


def soak_rows(folder: Path, minutes: float) -> list[Row]:
    """Measure stretch after stretch on one daemon that learns while its Python is paused. Raises RunError."""
    traffic, rows = make_traffic(folder), []
    with daemon_on_sockets(folder / "soak", PAUSED_RUN) as (ours, sender):
        pacer = socket_pacer(folder, traffic, sender)
        for number in range(max(1, round(minutes * 60.0 / STRETCH))):
            minute, row = (number + 1) * STRETCH / 60.0, _stretch(ours, pacer, traffic, STRETCH)
            rows.append({"label": f"{minute:.1f} min", "minute": minute, **row})
            messages.print(f"{minute:.1f} of {minutes:g} minutes", highlight=False)
    return rows


def _stretch(ours: Observer, pacer: Pacer, traffic: Traffic, seconds: float) -> Row:
    """Some seconds at 100 kHz. cpu_share: of one core, all threads."""
    before = ours.cpu_time()
    passage = pacer.send(round(seconds / FRAME), FRAME)
    return {
        "khz": passage.index.size * RATES / passage.seconds / 1e3,
        "cpu_share": (ours.cpu_time() - before) / passage.seconds,
        "lost_samples": passage.lost(traffic),
        "repeated_samples": passage.repeated,
        "given_up": int(np.sum(passage.sent == 0)),
        **latency_of(passage.latencies(traffic, open_only=False)),
        "memory_mib": ours.memory() / _MEBIBYTE,
        "threads": ours.resources.num_threads(),
        "descriptors": ours.resources.num_fds(),
    }
