"""Files as other tools write them, with a bench file that describes their columns."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import EXAMPLE_BENCH, Bench, load_bench
from observer_rt.files.formats import open_recording
from observer_rt.files.signals.recording import Recording
from observer_rt.files.signals.stream import SignalStream

RATE = 100e3
COLUMNS = """
[recording]
{options}
[recording.time]
column = "t"
{time}
[recording.rail_pressure]
column = "p_Rail"
{rail}
[recording.needle_lift]
column = "lift"
unit = "um"
[recording.line_pressure]
column = "p_Line"
unit = "MPa"
"""


def bench(
    folder: Path, options: str = "", rail: str = 'unit = "bar"', text: str = COLUMNS, time: str = 'unit = "ms"'
) -> Bench:
    path = folder / "bench.toml"
    path.write_text(EXAMPLE_BENCH.read_text() + text.format(options=options, rail=rail, time=time))
    return load_bench(path)


def signals(samples: int) -> dict[str, NDArray[np.float64]]:
    """Distinct values that text of a few digits holds exactly: time [s], bar, um, MPa."""
    k = np.arange(samples)
    return {
        "t": k / RATE,
        "p_Rail": 1000.0 + k % 7 / 2.0,
        "lift": (k % 100).astype(np.float64),
        "p_Line": 99.0 + k % 5 / 4.0,
    }


def write(folder: Path, text: str, encoding: str = "utf-8") -> Path:
    path = folder / "foreign.csv"
    path.write_bytes(text.encode(encoding))
    return path


def read(path: Path, user_bench: Bench) -> Recording:
    return open_recording(path, user_bench.injector).collected()


def write_rows(folder: Path, time: NDArray[np.float64], digits: int = 7, **changes: NDArray[np.float64]) -> Path:
    """A CSV file of signals at times [s], printed in ms with so many digits."""
    columns = {**signals(time.size), **changes}
    rows = zip(time * 1e3, columns["p_Rail"], columns["lift"], columns["p_Line"], strict=True)
    return write(folder, "t,p_Rail,lift,p_Line\n" + "".join(f"{t:.{digits}f},{p},{x},{y}\n" for t, p, x, y in rows))


def opened(path: Path, folder: Path, options: str = "", text: str = COLUMNS) -> SignalStream:
    return open_recording(path, bench(folder, options, text=text).injector)
