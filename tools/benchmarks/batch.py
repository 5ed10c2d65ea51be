"""`tools/bench batch`: what many recordings cost through `observer-rt batch`, of all processes from start to end."""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from observer_rt.files.formats import write_recording
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.errors import RunError
from tools.benchmarks import command_line as cli
from tools.benchmarks.campaign import Bar, Row, conclude, frame_of, messages, table
from tools.benchmarks.scoring import bench_text
from tools.benchmarks.speed.traffic import SAMPLE_RATE, worn_loop

INJECTIONS = 50  # 25 a second, of three pressures, that a file repeats
STEP = 50e3  # Pa of rail pressure from file to file: what a CAN signal resolves, far from what matters
ONE = ("--workers", "1")
LAUNCHER = """
import resource, subprocess, sys
code = subprocess.call(sys.argv[1:])
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, used.ru_maxrss, file=sys.stderr)
sys.exit(code)
"""  # small itself, for a process begins with the memory of the one that started it
COLUMNS = ("work", "files", "injections", "clock", "processor", "peak_mib")
BARS = (
    Bar("injections_per_s_per_core", "per_core", "max", of="work == 'many'"),
    Bar("injections_per_s_per_core_learning", "per_core", "max", of="work == 'learning'"),
    Bar("efficiency_2_workers", "efficiency", "max", of="work == 'two workers'"),
    Bar("peak_memory_mib", "peak_mib", "max"),
    Bar("memory_growth_share", "growth", "max", most=0.05, of="work == 'many'"),
)


def write_files(folder: Path, files: int, repeats: int) -> Path:
    """A folder below another with Parquet files, each with a content of its own."""
    target = Path(tempfile.mkdtemp(dir=folder))
    once = worn_loop(INJECTIONS)
    rail, lift, line = (np.tile(values, repeats) for values in once.signals.values())
    for number in range(files):
        recording = Recording(np.arange(rail.size) / SAMPLE_RATE, rail + number * STEP, lift, line)
        write_recording(target / f"{number}.parquet", recording)
    return target


def run(work: str, sources: Path, files: int, injections: int, bench: Path, *options: str) -> Row:
    """Seconds by the clock and of all processors, memory of its largest process. Raises `RunError` if it fails."""
    messages.print(f"{work} ...", highlight=False)
    with tempfile.TemporaryDirectory(prefix="batch-") as results:
        words = ["batch", sources, "--out", f"{results}/out", "--bench", bench, "--json", *options]
        command = [sys.executable, "-c", LAUNCHER, sys.executable, "-m", "observer_rt", *words]
        begin = time.perf_counter()
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
        clock = time.perf_counter() - begin
    if done.returncode != 0:
        raise RunError(f"batch ended with {done.returncode}: {done.stderr}")
    summary = json.loads(done.stdout)
    processor, kibibytes = map(float, done.stderr.splitlines()[-1].split())
    # the first and the last may be cut off by the ends of a recording
    if summary["done"] != files or summary["injections"] < injections - 2 * files:
        raise RunError(f"batch found {summary}, not {injections} injections of {files} files")
    values = (work, work, files, injections, clock, processor, kibibytes / 1024.0)
    return dict(zip(("label", *COLUMNS), values, strict=True))


@cli.app.command(epilog="Example: tools/bench batch --quick")
def batch(
    quick: Annotated[bool, typer.Option("--quick", help="Few and short files: a look, no verdict.")] = False,
    out: cli.OutOption = None,
) -> None:
    """What many recordings cost through `observer-rt batch`: a core, two workers, learning, memory."""
    (repeats, files), out = (3, 4) if quick else (8, 8), out or Path("build/batch")
    count = repeats * INJECTIONS
    with tempfile.TemporaryDirectory(prefix="batch-files-") as name:
        folder, bench = Path(name), Path(name) / "bench.toml"
        bench.write_text(bench_text())
        few, many = write_files(folder, 2, repeats), write_files(folder, files, repeats)
        rows = [
            run("few", few, 2, 2 * count, bench, "--no-learning", *ONE),
            run("many", many, files, files * count, bench, "--no-learning", *ONE),
            run("two workers", many, files, files * count, bench, "--no-learning", "--workers", "2"),
            run("learning", many, files, files * count, bench, *ONE),
        ]
    frame, (few_row, many_row) = frame_of(rows), rows[:2]
    a_file = (many_row["processor"] - few_row["processor"]) / (files - 2)
    start = few_row["processor"] - 2 * a_file  # which is not of any file
    frame["per_core"] = frame["injections"] / (frame["processor"] - start)
    frame["efficiency"] = many_row["clock"] / (2.0 * frame["clock"])
    frame["growth"] = frame["peak_mib"] / few_row["peak_mib"] - 1.0
    shown = table(frame, "work", {name: (name, "max") for name in COLUMNS[1:]}).drop("all")
    conclude(frame, BARS, {"batch": shown}, out)
