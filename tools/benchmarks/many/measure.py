"""All batches of `tools/bench batch`, and the core alone on frames of the same injections."""

import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from observer_rt.foundation.units import MICROSECOND
from tools.benchmarks.many.run import SOURCES, Files, Taken, Work, run
from tools.benchmarks.scoring import bench_at
from tools.benchmarks.speed.core_alone import (
    INJECTIONS,
    Watch,
    core_alone,
    frames_of,
    repeated_injections,
)
from tools.benchmarks.speed.evaluated import PARQUET
from tools.benchmarks.speed.traffic import SAMPLE_RATE, Ids, write_bench

_PASSES = 3
_CORE_REPEATS = 5


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
    """Time over a quantity as a straight line: start [s], slope [s each], and the point farthest off it.

    farthest: share of the longest time.
    """

    start: float
    slope: float
    farthest: float


def line_through(points: Sequence[tuple[float, float]]) -> Line:
    """By least squares."""
    x, y = np.array(points).T
    slope, start = np.polyfit(x, y, 1)
    return Line(float(start), float(slope), float(np.max(np.abs(start + slope * x - y)) / np.max(y)))


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

    def by_number(self, of: Callable[[Taken], float], runs: Sequence[Taken]) -> Line:
        """A time, over the number of files."""
        return line_through([(each.work.files.number, of(each)) for each in runs])

    def by_length(self, of: Callable[[Taken], float]) -> Line:
        """A time, over the seconds of the one file."""
        return line_through([(each.work.seconds, of(each)) for each in self.lengths])

    def per_core(self, taken: Taken) -> float:
        """Injections a second of processor time beyond that of the start, all processes together."""
        start = self.by_number(processor, self.numbers).start
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


def clock(taken: Taken) -> float:
    """By the clock [s]."""
    return taken.clock


def processor(taken: Taken) -> float:
    """Of all processors [s]."""
    return taken.processor


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
