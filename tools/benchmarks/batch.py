"""`tools/bench batch`: what many recordings cost through `observer-rt batch`, beside the compiled core alone."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import psutil
import typer

from observer_rt.foundation.errors import RunError
from observer_rt.foundation.units import MICROSECOND
from tests.observed_plants import bench_at
from tools.benchmarks.command_line import JsonOption, app, messages
from tools.benchmarks.report import NOTHING, Columns, Figure, Shown, figures_table, list_of, put_out
from tools.benchmarks.speed.core_alone import (
    CAN_LOG,
    INJECTIONS,
    MDF4,
    ONCE,
    PARQUET,
    SUFFIXES,
    Watch,
    core_alone,
    frames_of,
    repeated_injections,
    write_source,
)
from tools.benchmarks.speed.traffic import SAMPLE_RATE, Ids, write_bench

_STEP = 50e3  # Pa of rail pressure from file to file: what a CAN signal resolves, far from what matters
SOURCES = tuple(SUFFIXES)
_LOOK = 0.1  # s to the next one at memory
_KIBIBYTES = 1024  # in a MiB, as the kernel counts
_COMMAND = (sys.executable, "-m", "observer_rt", "batch")
_PASSES = 3
_CORE_REPEATS = 5
_FLOOR = "the compiled core alone, nothing learned"


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
            path = place / f"{number}{SUFFIXES[self.source]}"
            if not path.exists():
                write_source(self.source, path, repeated_injections(self.repeats, number * _STEP))
            link = chosen / path.name
            if not link.exists():
                link.hardlink_to(path)
        return chosen


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


@dataclass(frozen=True)
class ManyPlan:
    """repeats: of the injections of 2 s, in a file; numbers: of files; lengths: repeats in a single file."""

    repeats: int
    numbers: tuple[int, ...]
    lengths: tuple[int, ...]


FULL = ManyPlan(8, (2, 4, 8), (4, 16, 64))
QUICK = ManyPlan(3, (2, 4), (2, 8))


@dataclass(frozen=True)
class Line:
    """Time over a quantity as a straight line: start [s], and the point farthest off it.

    farthest: share of the longest time.
    """

    start: float
    farthest: float


def line_through(points: Sequence[tuple[float, float]]) -> Line:
    """By least squares."""
    x, y = np.array(points).T
    slope, start = np.polyfit(x, y, 1)
    return Line(float(start), float(np.max(np.abs(start + slope * x - y)) / np.max(y)))


Time = Callable[[Taken], float]
CLOCK: Time = attrgetter("clock")
PROCESSOR: Time = attrgetter("processor")


@dataclass(frozen=True)
class Many:
    """What was measured. core_per_s: injections a second through the compiled core alone, on one core.

    numbers, two_workers: batches of more and more files; lengths: of one file, longer and longer; sources: of each
    kind, the most files; learned: the same of the first kind, learning.
    """

    load: tuple[float, float]
    core_per_s: float
    numbers: tuple[Taken, ...]
    two_workers: tuple[Taken, ...]
    lengths: tuple[Taken, ...]
    sources: tuple[Taken, ...]
    learned: Taken

    def by_number(self, of: Time, runs: Sequence[Taken]) -> Line:
        """A time, over the number of files."""
        return line_through([(each.work.files.number, of(each)) for each in runs])

    def by_length(self, of: Time) -> Line:
        """A time, over the seconds of the one file."""
        return line_through([(each.work.seconds, of(each)) for each in self.lengths])

    def per_core(self, taken: Taken) -> float:
        """Injections a second of processor time beyond that of the start, all processes together."""
        start = self.by_number(PROCESSOR, self.numbers).start
        return taken.work.injections / (taken.processor - start)

    @property
    def efficiency(self) -> float:
        """Of two workers: files a second, once both work, against twice those of one; 1 is the best there is."""
        return self.numbers[-1].a_file / (2.0 * self.two_workers[-1].a_file)

    @property
    def efficiency_with_start(self) -> float:
        """The same of the whole command on the most files."""
        return self.numbers[-1].clock / (2.0 * self.two_workers[-1].clock)

    @property
    def peak_mib(self) -> float:
        """Of the largest process of all."""
        return max(each.peak_mib for each in (*self.numbers, *self.lengths, *self.sources, self.learned))

    @property
    def memory_growth(self) -> float:
        """By how much the longest file takes more memory than the shortest, as a share."""
        return self.lengths[-1].peak_mib / self.lengths[0].peak_mib - 1.0


def measure_many(plan: ManyPlan, progress: Callable[[str], None]) -> Many:
    """Batch after batch. progress: is told what comes next. Raises RunError."""
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory(prefix="batch-files-") as name:
        folder = Path(name)
        bench = write_bench(folder / "bench", "virtual", "none", Ids())

        def taken(work: Work) -> Taken:
            files = work.files
            learning = ", learning" if work.learning else ""
            progress(
                f"{files.number} x {work.seconds:g} s of {files.source}, {work.workers} workers{learning}"
            )
            return run(work, folder, bench)

        progress("the core alone")
        core = _core_per_s()
        most = plan.numbers[-1]
        for source in SOURCES:  # what is not compiled yet
            taken(Work(Files(source, 1, 1), learning=True))
        found = [
            tuple(taken(Work(Files(PARQUET, number, plan.repeats), workers)) for number in plan.numbers)
            for workers in (1, 2)
        ]
        lengths = tuple(taken(Work(Files(PARQUET, 1, repeats))) for repeats in plan.lengths)
        others = tuple(taken(Work(Files(source, most, plan.repeats))) for source in SOURCES[1:])
        learned = taken(Work(Files(PARQUET, most, plan.repeats), learning=True))
    numbers, two_workers = found
    after = os.getloadavg()[0]
    return Many((load, after), core, numbers, two_workers, lengths, (numbers[-1], *others), learned)


def _core_per_s() -> float:
    """The best of some passes, by the time of its processor."""
    bench, recording = bench_at(SAMPLE_RATE), repeated_injections(_CORE_REPEATS)
    blocks, core, beside = frames_of(bench, recording), Watch(), Watch()
    for _ in range(1 + _PASSES):
        core_alone(bench, blocks, core, beside)
    seconds = core.least(recording.samples).processor * recording.samples * MICROSECOND
    return INJECTIONS * _CORE_REPEATS / seconds


def shown(many: Many) -> Iterator[Shown]:
    """Figures beside their bars, then every batch."""
    yield figures_table(figures(many), "batch", many.load)
    groups = many.numbers, many.two_workers, many.lengths, (*many.sources[1:], many.learned)
    yield list_of("batches", groups, _columns(many), names=3)
    start = many.by_number(CLOCK, many.numbers).start
    yield f"beyond the start of {start:.1f} s; the core alone: {many.core_per_s:.0f} injections a second"


def many_document(many: Many) -> dict[str, Any]:
    """`figures` by name, `details` of what was measured."""
    return {
        "figures": {each.name: each.value for each in figures(many)},
        "details": {
            **asdict(many),
            "missed": [each.name for each in figures(many) if each.is_met is False],
        },
    }


def figures(many: Many) -> list[Figure]:
    """All of them."""
    per_core = {each.work.files.source: many.per_core(each) for each in many.sources}
    parquet, mdf4, log = (per_core[source] / many.core_per_s for source in (PARQUET, MDF4, CAN_LOG))
    start = many.by_number(CLOCK, many.numbers)
    longest, shortest = (many.lengths[place].work.seconds for place in (-1, 0))
    better, off = f"{_FLOOR}; the better of the next two", "a straight line through all"
    twice = "one worker, twice; from file to file, once all work"
    beside = f"a file of {longest:g} s beside one of {shortest:g} s"
    return [
        Figure("injections_per_s_per_core", per_core[PARQUET], "Parquet, nothing learned"),
        Figure("injections_per_s_per_core_learning", many.per_core(many.learned), "Parquet"),
        Figure("floor_share", max(parquet, mdf4), better, at_least=0.5),
        Figure("floor_share_parquet", parquet, _FLOOR),
        Figure("floor_share_mdf4", mdf4, _FLOOR),
        Figure("floor_share_mdf4_can_log", log, _FLOOR),
        Figure("efficiency_2_workers", many.efficiency, twice, at_least=0.9),
        Figure("efficiency_2_workers_with_start", many.efficiency_with_start, "the same, whole command"),
        Figure("off_linear_files", start.farthest, off, 0.05),
        Figure("off_linear_length", many.by_length(CLOCK).farthest, off, 0.05),
        Figure("peak_memory_mib", many.peak_mib, "largest process of all"),
        Figure("memory_growth_share", many.memory_growth, beside, 0.05),
        Figure("start_s", start.start, "no files at all, by that line"),
    ]


def _columns(many: Many) -> Columns[Taken]:
    def per_core(taken: Taken) -> str:
        rate = many.per_core(taken)  # of a short file: little beyond a start that is not known so well
        return f"{rate:.0f}" if rate > 0.0 else NOTHING

    return {
        "files": "{.work.files.number}",
        "of": "{.work.seconds:g} s",
        "": lambda each: f"{each.work.files.source}{', learning' if each.work.learning else ''}",
        "workers": "{.work.workers}",
        "clock s": "{.clock:.1f}",
        "processor s": "{.processor:.1f}",
        "MiB": "{.peak_mib:.0f}",
        "injections / s / core": per_core,
    }


@app.command(epilog="Examples: tools/bench batch; tools/bench batch --quick --json")
def batch(
    quick: Annotated[bool, typer.Option("--quick", help="Few and short files: a look, no verdict.")] = False,
    as_json: JsonOption = False,
) -> None:
    """What many recordings cost through `observer-rt batch`, beside the compiled core alone."""
    found = measure_many(
        QUICK if quick else FULL, lambda text: messages.print(f"{text} ...", highlight=False)
    )
    put_out(as_json, many_document(found), shown(found), 150)
