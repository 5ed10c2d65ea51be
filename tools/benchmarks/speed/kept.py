"""Our daemon with and without evidence kept, sent to in turn: is the loop's time, or its tail, another one?"""

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from tools.benchmarks.speed.observers import RUN
from tools.benchmarks.speed.pace import Latency, latency_of, socket_pacer
from tools.benchmarks.speed.sustained import daemon_on_sockets
from tools.benchmarks.speed.traffic import SAMPLE_RATE, SAMPLES, Traffic

WITHOUT, WITH = "nothing kept", "evidence kept"
CHANGES = {  # of the example's bench file; so many of a kind that every event is written
    WITHOUT: (),
    WITH: (('# folder = "evidence" ', 'folder = "evidence" '), ("per_point = 8 ", "per_point = 1000 ")),
}
TURN = 5.0  # s
_PERIOD = SAMPLES / SAMPLE_RATE  # s


@dataclass(frozen=True)
class Turn:
    """A turn. cpu_share: of one core, all threads of the daemon, without the process that writes."""

    cpu_share: float
    lost_samples: int
    latency: Latency


@dataclass(frozen=True)
class KeptRow:
    """One of the two, turn by turn, of which the median counts: others disturb some. kept: its last word on that."""

    turns: tuple[Turn, ...]
    kept: str

    @property
    def cpu_share(self) -> float:
        """Of one core."""
        return median(turn.cpu_share for turn in self.turns)

    @property
    def p50(self) -> float:
        """Latency [us]."""
        return median(turn.latency.p50 for turn in self.turns)

    @property
    def p999(self) -> float:
        """Latency [us]."""
        return median(turn.latency.p999 for turn in self.turns)

    @property
    def lost_samples(self) -> int:
        """Of all turns."""
        return sum(turn.lost_samples for turn in self.turns)


def measure_kept(folder: Path, traffic: Traffic, seconds: float) -> Mapping[str, KeptRow]:
    """Send to both at 100 kHz for so long each, turn by turn. Raises RunError."""
    turns: dict[str, list[Turn]] = {name: [] for name in CHANGES}
    with ExitStack() as stack:
        daemons = {
            name: stack.enter_context(daemon_on_sockets(folder / name.split()[0], RUN, *changes))
            for name, changes in CHANGES.items()
        }
        pacers = {name: socket_pacer(folder, traffic, sender) for name, (_, sender) in daemons.items()}
        for pacer in pacers.values():
            pacer.send(round(1.0 / _PERIOD), _PERIOD)  # meets what is met for the first time
        for name in max(1, round(seconds / TURN)) * tuple(CHANGES):
            ours, _ = daemons[name]
            before = ours.cpu_time()
            passage = pacers[name].send(round(TURN / _PERIOD), _PERIOD)
            share = (ours.cpu_time() - before) / passage.seconds
            latency = latency_of(passage.latencies(traffic, open_only=False))
            turns[name].append(Turn(share, passage.lost(traffic), latency))
    return {
        name: KeptRow(tuple(turns[name]), next((line for line in ours.said if "events kept" in line), ""))
        for name, (ours, _) in daemons.items()
    }
