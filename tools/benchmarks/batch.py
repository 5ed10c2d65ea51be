"""`tools/bench batch`: what many recordings cost through `observer-rt batch`, beside the compiled core alone."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import psutil
import typer

from observer_rt.foundation.errors import RunError
from observer_rt.foundation.units import MICROSECOND
from tests.observed_plants import bench_at
from tools.benchmarks.command_line import JsonOption, app, messages
from tools.benchmarks.report import Figure, Shown, figures_table, put_out
from tools.benchmarks.speed.core_alone import (
    INJECTIONS,
    PARQUET,
    Watch,
    core_alone,
    frames_of,
    repeated_injections,
    write_source,
)
from tools.benchmarks.speed.traffic import SAMPLE_RATE, Ids, write_bench

_STEP = 50e3  # Pa of rail pressure from file to file: what a CAN signal resolves, far from what matters
_LOOK = 0.1  # s to the next one at memory
_KIBIBYTES = 1024  # in a MiB, as the kernel counts
_COMMAND = (sys.executable, "-m", "observer_rt", "batch")
_PASSES = 3
_CORE_REPEATS = 5


@dataclass(frozen=True)
class Work:
    """Parquet files for a batch; repeats: of the injections of `core_alone`, in each."""

    files: int
    repeats: int
    workers: int = 1
    learning: bool = False

    @property
    def injections(self) -> int:
        """In all files."""
        return self.files * self.repeats * INJECTIONS

    def written(self, folder: Path) -> Path:
        """A new folder below another with the files, of which each has a content of its own."""
        place = Path(tempfile.mkdtemp(dir=folder))
        for number in range(self.files):
            write_source(
                PARQUET, place / f"{number}.parquet", repeated_injections(self.repeats, number * _STEP)
            )
        return place


@dataclass(frozen=True)
class Taken:
    """By the clock and of all processors [s], from the command to its end; peak_mib: of its largest process."""

    work: Work
    clock: float
    processor: float
    peak_mib: float


def run(work: Work, folder: Path, bench: Path) -> Taken:
    """Raises `RunError` for a batch that fails, or finds other injections than are there."""
    sources = work.written(folder)
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
    # the first and the last may be cut off by the ends of a recording
    if found["done"] != work.files or found["injections"] < work.injections - 2 * work.files:
        raise RunError(f"batch found {found}, not {work}")
    return Taken(work, clock, ended[2].ru_utime + ended[2].ru_stime, peak)


def _largest_mib(process: int) -> float:
    """The most that any process of a tree, of those that are still there, has taken so far."""
    peaks = []
    with suppress(psutil.NoSuchProcess):
        for each in (found := psutil.Process(process), *found.children(recursive=True)):
            with suppress(OSError):
                lines = Path(f"/proc/{each.pid}/status").read_text().splitlines()
                peaks += [float(line.split()[1]) for line in lines if line.startswith("VmHWM:")]
    return max(peaks, default=0.0) / _KIBIBYTES


@dataclass(frozen=True)
class Many:
    """Batches measured: of few files and of many, the latter also by two workers and learning.

    core_per_s: injections a second through the compiled core alone, on one core; load: of the machine, before, after.
    """

    load: tuple[float, float]
    core_per_s: float
    few: Taken
    many: Taken
    two_workers: Taken
    learning: Taken

    def per_core(self, taken: Taken) -> float:
        """Injections a second of processor time beyond that of the start, all processes together."""
        files = self.many.work.files - self.few.work.files
        start = self.few.processor - self.few.work.files * (self.many.processor - self.few.processor) / files
        return taken.work.injections / (taken.processor - start)


def measure_many(repeats: int, files: int, progress: Callable[[str], None]) -> Many:
    """Batch after batch; progress: is told what comes next. Raises `RunError`."""
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory(prefix="batch-files-") as name:
        folder = Path(name)
        bench = write_bench(folder / "bench", "virtual", "none", Ids())

        def taken(work: Work) -> Taken:
            progress(f"{work}")
            return run(work, folder, bench)

        progress("the core alone")
        core = _core_per_s()
        few, many, two_workers, learning = map(
            taken,
            (
                Work(2, repeats),
                Work(files, repeats),
                Work(files, repeats, workers=2),
                Work(files, repeats, learning=True),
            ),
        )
    return Many((load, os.getloadavg()[0]), core, few, many, two_workers, learning)


def _core_per_s() -> float:
    """The best of some passes, by the time of its processor."""
    bench, recording = bench_at(SAMPLE_RATE), repeated_injections(_CORE_REPEATS)
    blocks, core, beside = frames_of(bench, recording), Watch(), Watch()
    for _ in range(1 + _PASSES):
        core_alone(bench, blocks, core, beside)
    seconds = core.least(recording.samples).processor * recording.samples * MICROSECOND
    return INJECTIONS * _CORE_REPEATS / seconds


def shown(many: Many) -> Iterator[Shown]:
    """Figures beside their bars."""
    yield figures_table(figures(many), "batch", many.load)


def many_document(many: Many) -> dict[str, Any]:
    """`figures` by name, `details` of what was measured."""
    missed = [figure.name for figure in figures(many) if figure.is_met is False]
    return {
        "figures": {figure.name: figure.value for figure in figures(many)},
        "details": {**asdict(many), "missed": missed},
    }


def figures(many: Many) -> list[Figure]:
    """All of them."""
    per_core = many.per_core(many.many)
    efficiency = many.many.clock / (2.0 * many.two_workers.clock)
    peak = max(taken.peak_mib for taken in (many.few, many.many, many.two_workers, many.learning))
    growth = many.many.peak_mib / many.few.peak_mib - 1.0
    return [
        Figure("injections_per_s_per_core", per_core, "nothing learned"),
        Figure("injections_per_s_per_core_learning", many.per_core(many.learning), "learning"),
        Figure("floor_share", per_core / many.core_per_s, "the compiled core alone", at_least=0.5),
        Figure("efficiency_2_workers", efficiency, "one worker, twice; whole command"),
        Figure("peak_memory_mib", peak, "largest process of all"),
        Figure("memory_growth_share", growth, f"{many.many.work.files} files beside 2", 0.05),
    ]


@app.command(epilog="Examples: tools/bench batch; tools/bench batch --quick --json")
def batch(
    quick: Annotated[bool, typer.Option("--quick", help="Few and short files: a look, no verdict.")] = False,
    as_json: JsonOption = False,
) -> None:
    """What many recordings cost through `observer-rt batch`, beside the compiled core alone."""
    repeats, files = (3, 4) if quick else (8, 8)
    found = measure_many(repeats, files, lambda text: messages.print(f"{text} ...", highlight=False))
    put_out(as_json, many_document(found), shown(found), 150)
