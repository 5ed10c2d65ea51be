"""One batch as a user starts it, and what it took."""

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from observer_rt.foundation.errors import RunError
from tools.benchmarks.many.files import Files
from tools.benchmarks.speed.core_alone import INJECTIONS, ONCE

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
    """By the clock and of all processors [s], from the command to its end; peak_mib: of its largest process."""

    work: Work
    clock: float
    processor: float
    peak_mib: float


def run(work: Work, folder: Path, bench: Path) -> Taken:
    """Raises `RunError` for one that fails, or finds other injections than are there."""
    sources = work.files.written(folder)
    with tempfile.TemporaryDirectory(prefix="batch-") as name:
        results = Path(name)
        options = ["--workers", str(work.workers), *([] if work.learning else ["--no-learning"])]
        words = [*_COMMAND, sources, "--out", results / "out", "--bench", bench, "--json", *options]
        with (results / "said").open("w+") as said, (results / "told").open("w+") as told:
            begin = time.perf_counter()
            # reaped here, for only `wait4` tells what it and all that it waited for took
            process = subprocess.Popen(list(map(str, words)), stdout=told, stderr=said)
            _, status, usage = os.wait4(process.pid, 0)
            clock = time.perf_counter() - begin
            process.returncode = os.waitstatus_to_exitcode(status)
            said.seek(0)
            told.seek(0)
            if process.returncode != 0:
                raise RunError(f"batch ended with {process.returncode}: {said.read()}")
            found = json.load(told)
    # the first and the last may be cut off by the ends of a recording
    if found["done"] != work.files.number or found["injections"] < work.injections - 2 * work.files.number:
        raise RunError(f"batch found {found}, not {work}")
    return Taken(work, clock, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / _KIBIBYTES)
