"""Recordings for a batch, each of a content of its own, for copies are not done again."""

from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from observer_rt.evaluation.convert import convert
from observer_rt.recording.signals.writers import write_whole
from tools.benchmarks.scoring import bench_at
from tools.benchmarks.speed.core_alone import repeated_injections
from tools.benchmarks.speed.evaluated import CAN_LOG, MDF4, PARQUET
from tools.benchmarks.speed.traffic import SAMPLE_RATE

_STEP = 50e3  # Pa of rail pressure from file to file: what a CAN signal resolves, far from what matters
_SUFFIXES = {PARQUET: ".parquet", MDF4: ".mf4", CAN_LOG: ".mf4"}
SOURCES = tuple(_SUFFIXES)


@dataclass(frozen=True)
class Files:
    """Files of a kind; repeats: of the injections of `core_alone`, in each."""

    source: str
    number: int
    repeats: int

    def written(self, folder: Path) -> Path:
        """Their folder, below another; those that are there are kept."""
        place = folder / f"{self.source} {self.repeats}".replace(" ", "_")
        chosen = place / f"first_{self.number}"
        chosen.mkdir(parents=True, exist_ok=True)
        for number in range(self.number):
            path = place / f"{number}{_SUFFIXES[self.source]}"
            if not path.exists():
                self._write(path, number)
            link = chosen / path.name
            if not link.exists():
                link.hardlink_to(path)
        return chosen

    def _write(self, path: Path, number: int) -> None:
        recording = repeated_injections(self.repeats, number * _STEP)
        if self.source != CAN_LOG:
            write_whole(path, recording)
            return
        signals, frames = path.with_suffix(".parquet"), path.with_suffix(".blf")
        quiet = Console(quiet=True)
        write_whole(signals, recording)
        convert(signals, frames, bench_at(SAMPLE_RATE), (), True, quiet)
        convert(frames, path, None, (), True, quiet)
        signals.unlink()
        frames.unlink()
