"""One batch as a user starts it, and what it took."""

import json
import os
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import psutil
from rich.console import Console

from observer_rt.evaluation.convert import convert
from observer_rt.foundation.errors import RunError
from observer_rt.recording.signals.table_writers import write_whole
from tools.benchmarks.scoring import bench_at
from tools.benchmarks.speed.core_alone import INJECTIONS, ONCE, repeated_injections
from tools.benchmarks.speed.evaluated import CAN_LOG, MDF4, PARQUET
from tools.benchmarks.speed.traffic import SAMPLE_RATE

_STEP = 50e3  # Pa of rail pressure from file to file: what a CAN signal resolves, far from what matters
_SUFFIXES = {PARQUET: ".parquet", MDF4: ".mf4", CAN_LOG: ".mf4"}
SOURCES = tuple(_SUFFIXES)
_LOOK = 0.1  # s to the next one at memory
_KIBIBYTES = 1024  # in a MiB, as the kernel counts
_COMMAND = (sys.executable, "-m", "observer_rt", "batch")


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


@dataclass(frozen=True)
class Work:
    """What is given to a batch."""

    files: Files
    workers: int = 1
    learning: bool = False

    @property
    def injections(self) -> int:
        """In all files."""
        return self.files.number * self.files.repeats * INJECTIONS

    @property
    def seconds(self) -> float:
        """Of recording in each file."""
        return self.files.repeats * ONCE


@dataclass(frozen=True)
class Taken:
    """By the clock and of all processors [s], from the command to its end.

    peak_mib: of its largest process; a_file: seconds of the clock from file to file, once all workers have one behind
    them.
    """

    work: Work
    clock: float
    processor: float
    peak_mib: float
    a_file: float


def run(work: Work, folder: Path, bench: Path) -> Taken:
    """Raises `RunError` for one that fails, or finds other injections than are there."""
    sources = work.files.written(folder)
    with tempfile.TemporaryDirectory(prefix="batch-") as name:
        results = Path(name)
        options = ["--workers", str(work.workers), *([] if work.learning else ["--no-learning"])]
        words = [*_COMMAND, sources, "--out", results / "out", "--bench", bench, "--json", *options]
        with (results / "said").open("w+") as said, (results / "told").open("w+") as told:
            begin = time.perf_counter()
            process = subprocess.Popen(list(map(str, words)), stdout=told, stderr=said)
            peak = 0.0
            # reaped here, for only `wait4` tells what it and all that it waited for took
            while not (ended := os.wait4(process.pid, os.WNOHANG))[0]:
                peak = max(peak, _largest_mib(process.pid))
                time.sleep(_LOOK)
            clock = time.perf_counter() - begin
            process.returncode = os.waitstatus_to_exitcode(ended[1])
            said.seek(0)
            told.seek(0)
            if process.returncode != 0:
                raise RunError(f"batch ended with {process.returncode}: {said.read()}")
            found = json.load(told)
        written = sorted(path.stat().st_mtime for path in results.glob("out/injections/**/*.parquet"))
    # the first and the last may be cut off by the ends of a recording
    if found["done"] != work.files.number or found["injections"] < work.injections - 2 * work.files.number:
        raise RunError(f"batch found {found}, not {work}")
    later = written[work.workers - 1 :]
    a_file = (later[-1] - later[0]) / (len(later) - 1) if len(later) > 1 else float("nan")
    return Taken(work, clock, ended[2].ru_utime + ended[2].ru_stime, peak, a_file)


def _largest_mib(process: int) -> float:
    """The most that any process of a tree, of those that are still there, has taken so far."""
    peaks = []
    with suppress(psutil.NoSuchProcess):
        for each in (found := psutil.Process(process), *found.children(recursive=True)):
            with suppress(OSError):
                lines = Path(f"/proc/{each.pid}/status").read_text().splitlines()
                peaks += [float(line.split()[1]) for line in lines if line.startswith("VmHWM:")]
    return max(peaks, default=0.0) / _KIBIBYTES
