"""How long `observer-rt run` takes until it says that it is ready, and how much memory it then has."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

from tools.benchmarks.speed.sustained import daemon_on_sockets

WARM_STARTS = 3


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
