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

from observer_rt.foundation.errors import RunError
from tools.benchmarks.many.files import Files
from tools.benchmarks.speed.core_alone import INJECTIONS, ONCE

_LOOK = 0.1  # s to the next one at memory
_KIBIBYTES = 1024  # in a MiB, as the kernel counts
_COMMAND = (sys.executable, "-m", "observer_rt", "batch")


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
