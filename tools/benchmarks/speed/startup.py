"""How long `observer-rt run` takes until it says that it is ready, and how much memory it then has."""

import tempfile
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from tools.benchmarks.speed.observers import RUN, observer
from tools.benchmarks.speed.sustained import socket_pair
from tools.benchmarks.speed.traffic import Ids, write_bench

WARM_STARTS = 3


@dataclass(frozen=True)
class Startup:
    """Seconds, the fastest of some warm starts; cold: with an empty folder of compiled code, None if left out."""

    warm_s: float
    cold_s: float | None
    memory_mib: float


def measure_startup(folder: Path, *, cold: bool) -> Startup:
    """Start it a few times, and once with nothing compiled."""
    starts = [_start(folder) for _ in range(1 + WARM_STARTS)][1:]  # the first may have to compile
    cold_s = None
    if cold:
        with tempfile.TemporaryDirectory(dir=folder) as empty:
            cold_s, _ = _start(folder, {"NUMBA_CACHE_DIR": empty})
    return Startup(min(seconds for seconds, _ in starts), cold_s, starts[-1][1] / (1 << 20))


def _start(folder: Path, environment: dict[str, str] | None = None) -> tuple[float, int]:
    """Seconds until ready, bytes then resident."""
    with ExitStack() as stack:
        pair = socket_pair(stack)
        descriptor = pair.receiver.fileno()
        bench = write_bench(folder / "startup", "descriptor", str(descriptor), Ids())
        started = stack.enter_context(observer([*RUN, bench], [descriptor], environment))
        return started.ready_after, started.memory()
