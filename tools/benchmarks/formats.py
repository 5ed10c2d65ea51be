"""What each file format holds, and how fast it is: the frames of a bench, written and read as the commands do.

Logs are read by python-can, too, in the same run and in turns.
"""

import random
import tempfile
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import can
import numpy as np
import typer

from observer_rt.bus.links.link import Frame
from observer_rt.files import formats as files
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.signals.recording import Recording
from tools.benchmarks.command_line import JsonOption, app
from tools.benchmarks.damage_files import standstill, write_log
from tools.benchmarks.report import Columns, put_out, table_of

PERIOD = 90_001  # ns between two frames, so that every digit of a stamp counts
START = 1_700_000_000_123_456_789  # ns since 1970
IDENTIFIERS = (0x100, 0x200, 0x300)
FD_BYTES, CLASSIC_BYTES = 64, 8
RUNS = 3


@dataclass(frozen=True)
class FormatResult:
    """One format: entries (frames or samples) written and read a second, bytes each, largest error of a stamp.

    faster: how many times as many are read as by python-can.
    """

    name: str
    holds: str
    stamp_error_ns: int
    written_per_s: float
    read_per_s: float
    bytes_each: float
    faster: float | None = None


def measure_formats(count: int) -> list[FormatResult]:
    """Write and read `count` frames in every log format, and as many samples in every recording format."""
    with tempfile.TemporaryDirectory() as folder:
        logs, signals = (
            files.suffixes_of(files.written(formats))
            for formats in (files.log_formats(), files.signal_formats())
        )
        with_fd = [suffix for suffix in logs if files.log_format(Path(f"bus{suffix}")).keeps_fd]
        return [
            *(_log(suffix, suffix, suffix in with_fd, count, Path(folder)) for suffix in logs),
            *(_log(f"{suffix} classic", suffix, False, count, Path(folder)) for suffix in with_fd),
            *(_recording(suffix, count, Path(folder)) for suffix in signals),
        ]


COLUMNS: Columns[FormatResult] = {
    "holds": "{.holds}",
    "stamps off by up to": "{.stamp_error_ns} ns",
    "written 1/s": "{.written_per_s:.0f}",
    "read 1/s": "{.read_per_s:.0f}",
    "python-can's, times": "{.faster:.2f}",
    "bytes each": "{.bytes_each:.0f}",
}


def formats_document(results: Sequence[FormatResult]) -> dict[str, Any]:
    """The results for a program."""
    figures: dict[str, float] = {}
    for each in results:
        name = each.name.replace(" ", "_").removeprefix(".")
        figures[f"{name}_written_per_s"] = round(each.written_per_s)
        figures[f"{name}_read_per_s"] = round(each.read_per_s)
        if each.faster is not None:
            figures[f"{name}_times_python_can"] = round(each.faster, 2)
    return {"figures": figures, "details": [vars(each) for each in results]}


@app.command(epilog="Example: tools/bench formats --frames 100000")
def formats(
    frames: Annotated[int, typer.Option(min=1000, help="CAN frames, or as many samples.")] = 50_000,
    as_json: JsonOption = False,
) -> None:
    """What each file format holds, how exactly it keeps time, and how fast it is written and read."""
    found = measure_formats(frames)
    table = table_of("file formats", "format", {each.name: each for each in found}, COLUMNS)
    put_out(as_json, formats_document(found), [table])


def _log(name: str, suffix: str, is_fd: bool, count: int, folder: Path) -> FormatResult:
    path = folder / f"bus{suffix}"
    frames = _frames(count, is_fd)
    (written,) = _seconds(lambda: write_log(path, frames, START))
    read, peer = _seconds(
        lambda: deque(files.open_log(path), maxlen=0), lambda: deque(can.LogReader(path), maxlen=0)
    )
    found = list(files.open_log(path))
    payloads = [entry.frame.payload for entry in frames]
    if [entry.frame.payload for entry in found] != payloads:
        raise AssertionError(f"{suffix} changed the frames")
    error = max(
        abs(one.frame.stamp_ns - other.frame.stamp_ns) for one, other in zip(found, frames, strict=True)
    )
    holds = "frames of CAN FD" if is_fd else "classic frames"
    return replace(_result(name, holds, error, count, written, read, path), faster=peer / read)


def _recording(suffix: str, count: int, folder: Path) -> FormatResult:
    path = folder / f"recording{suffix}"
    recording = standstill(count, 0.15e6)
    (written,) = _seconds(lambda: files.write_recording(path, recording))
    found: list[Recording] = []
    (read,) = _seconds(lambda: found.append(files.read_recording(path)))
    error = round(float(np.max(np.abs(found[0].time - recording.time))) * 1e9)
    return _result(f"{suffix} signals", "samples", error, count, written, read, path)


def _result(
    name: str, holds: str, error: int, count: int, written: float, read: float, path: Path
) -> FormatResult:
    return FormatResult(name, holds, error, count / written, count / read, path.stat().st_size / count)


def _frames(count: int, is_fd: bool) -> list[LogFrame]:
    chance = random.Random(1)
    size = FD_BYTES if is_fd else CLASSIC_BYTES
    return [
        LogFrame(
            Frame(IDENTIFIERS[n % 3], chance.randbytes(size), START + n * PERIOD, False, is_fd, is_fd),
            "1",
        )
        for n in range(count)
    ]


def _seconds(*works: Callable[[], object]) -> list[float]:
    """The shortest of several runs of each, in turns: other programs only lengthen one."""
    durations: list[list[float]] = [[] for _ in works]
    for _ in range(RUNS):
        for work, taken in zip(works, durations, strict=True):
            begun = time.perf_counter()
            work()
            taken.append(time.perf_counter() - begun)
    return [min(taken) for taken in durations]
