"""Our daemon for as long as one likes, at full rate and with its Python disturbed: what grows, what is lost?"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from tools.benchmarks.speed.observers import PAUSED_RUN, Observer
from tools.benchmarks.speed.pace import Latency, latency_of, socket_pacer
from tools.benchmarks.speed.sustained import daemon_on_sockets, farewell
from tools.benchmarks.speed.traffic import RATES, SAMPLE_RATE, SAMPLES, make_traffic

STRETCH = 10.0  # s
SETTLED = 0.2  # of the soak, after which nothing should grow any more
FEWEST = 10  # stretches a line is put through
_MEBIBYTE = 1 << 20


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
                    _entries(ours, "task"),
                    _entries(ours, "fd"),
                )
            )
    return Soak(tuple(found), farewell(ours))


def soak_table(soak: Soak, rows: int = 20) -> Table:
    """Some stretches, evenly spaced, and what came of all."""
    grown = soak.growth_mib_an_hour
    counted = f"{soak.lost} samples lost, {soak.repeated} told twice"
    title = f"{counted}; memory grows by {grown:.2f} MiB an hour once settled"
    columns = ("minute", "samples in", "told", "lost", "p50 / p99 / p99.9", "CPU", "MiB", "threads", "files")
    table = Table(*columns, title=title, title_justify="left")
    places = np.unique(np.linspace(0, len(soak.stretches) - 1, rows).round().astype(int))
    for each in (soak.stretches[place] for place in places):
        samples = (str(each.sent), str(each.told), str(each.lost), str(each.latency))
        process = (f"{each.memory_mib:.1f}", str(each.threads), str(each.descriptors))
        table.add_row(f"{each.minute:.1f}", *samples, f"{each.cpu_share:.2f}", *process)
    return table


def _entries(ours: Observer, what: str) -> int:
    return sum(1 for _ in Path(f"/proc/{ours.process.pid}/{what}").iterdir())
