"""The commands `speed` and `soak` of `tools/bench`: how fast, against whom, and for how long."""

import os
import tempfile
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from tools.benchmarks import command_line as cli
from tools.benchmarks.campaign import Bar, How, Row, conclude, frame_of, messages, table
from tools.benchmarks.speed.injectors import NUMBERS, measure_injectors
from tools.benchmarks.speed.roundtrip import BUSY, OURS, PEER, measure_roundtrips
from tools.benchmarks.speed.sustained import measure_startup, measure_sustained, soak_rows
from tools.benchmarks.speed.traffic import make_traffic


class Part(StrEnum):
    SUSTAINED = "sustained"
    ROUNDTRIP = "roundtrip"
    STARTUP = "startup"
    INJECTORS = "injectors"


SECONDS = {Part.SUSTAINED: (600.0, 10.0), Part.ROUNDTRIP: (50.0, 5.0), Part.INJECTORS: (60.0, 10.0)}
"""To each that is measured; `--quick`: the second."""
SETTLED = 0.2  # of the soak, after which nothing should grow any more
FEWEST = 10  # stretches a line is put through
_PARTY, _MOST = "party == '{}' and kept == True", f"label == '{NUMBERS[-1]} injectors'"
_PEER = _PARTY + " and lost_samples == 0"
_SUSTAINED, _STARTUP = "part == 'sustained'", "part == 'startup'"
BARS = (
    Bar("roundtrip_p50_vs_c_echo", "vs_echo", "max", most=1.25, of=_PARTY.format(OURS)),
    Bar("roundtrip_busy_p50_vs_c_echo", "vs_echo", "max", most=2.0, of=_PARTY.format(BUSY)),
    Bar("roundtrip_busy_p50_vs_quiet", "vs_ours", "max", most=1.1, of=_PARTY.format(BUSY)),
    Bar("roundtrip_speedup_vs_python_can", "vs_ours", "min", least=5.0, of=_PEER.format(PEER)),
    Bar("roundtrip_p999_excess", "excess", "max", most=1.5, of=_PARTY.format(OURS)),
    Bar("roundtrip_busy_p999_excess", "excess", "max", most=2.0, of=_PARTY.format(BUSY)),
    Bar("sustained_khz", "khz", "max", least=99.9, of=_SUSTAINED),
    Bar("cpu_share", "cpu_share", "max", most=0.35, of=_SUSTAINED),
    Bar("lost_samples", "lost_samples", "sum", most=0, of=_SUSTAINED),
    Bar("sustained_p999_us", "p999_us", "max", of=_SUSTAINED),
    Bar("ready_s", "ready_s", "min", most=1.2, of=_STARTUP),
    Bar("memory_mib", "memory_mib", "min", most=180.0, of=_STARTUP),
    Bar("injectors_cpu_share", "cpu_share", "max", most=0.75, of=_MOST),
    Bar("injectors_lost_samples", "lost_samples", "sum", most=0, of=_MOST),
    Bar("injectors_not_judged", "not_judged", "sum", most=0, of=_MOST),
)  # fmt: skip
SOAK_BARS = (
    Bar("lost_samples", "lost_samples", "sum", most=0),
    Bar("repeated_samples", "repeated_samples", "sum", most=0),
    Bar("memory_growth_mib_per_h", "growth", "max"),
    Bar("p999_us_max", "p999_us", "max"),
)
SOAK_COLUMNS: dict[str, tuple[str, How]] = {
    **{name: (name, "sum") for name in ("lost_samples", "repeated_samples")},
    **{name: (name, "max") for name in ("p50_us", "p99_us", "p999_us", "cpu_share")},
    **{name: (name, "max") for name in ("memory_mib", "threads", "descriptors")},
}


@cli.app.command(epilog="Examples: tools/bench speed; tools/bench speed --quick --only sustained,startup")
def speed(
    only: Annotated[str, typer.Option(help=f"Of {', '.join(Part)}, by commas (default: all).")] = "",
    quick: Annotated[bool, typer.Option("--quick", help="10 s of each: a look, no verdict.")] = False,
    seconds: Annotated[float | None, typer.Option(min=1.0, help="Of the sustained rate (600).")] = None,
    out: cli.OutOption = None,
) -> None:
    """How fast: round trip beside a C echo and python-can, load at 100 kHz, start, several injectors."""
    parts, before = cli.chosen_names(only, "--only", list(Part), list(Part)), os.getloadavg()
    out = out or Path("build/speed")
    lasts = {part: each[quick] for part, each in SECONDS.items()}
    lasts[Part.SUSTAINED] = seconds or lasts[Part.SUSTAINED]
    with tempfile.TemporaryDirectory(prefix="speed-") as name:
        folder = Path(name)
        traffic = make_traffic(folder)
        measures: dict[Part, Callable[[], list[Row]]] = {
            Part.SUSTAINED: lambda: measure_sustained(folder, traffic, lasts[Part.SUSTAINED]),
            Part.ROUNDTRIP: lambda: measure_roundtrips(folder, lasts[Part.ROUNDTRIP]),
            Part.STARTUP: lambda: measure_startup(folder),
            Part.INJECTORS: lambda: measure_injectors(folder, traffic, lasts[Part.INJECTORS]),
        }
        rows = []
        for part, measure in measures.items():
            if part in parts:
                length = f", {lasts[part]:g} s" if part in lasts else ""
                messages.print(f"{part}{length} ...", highlight=False)
                rows += measure()
    frame = frame_of(rows)
    columns = [name for name in frame if name not in ("part", "label", "party", "failed", "kept", "link")]
    tables = {
        part: table(frame[frame["part"] == part], "label", {n: (n, "max") for n in columns})
        .drop("all")
        .dropna(axis=1, how="all")
        for part in parts
    }
    load = f"load of the machine: {before[0]:.1f} before, {os.getloadavg()[0]:.1f} after"
    conclude(frame, BARS, tables, out, [load])


@cli.app.command(epilog="Example: tools/bench soak --minutes 60")
def soak(minutes: Annotated[float, typer.Option(min=0.1, help="Length.")] = 10.0, out: cli.OutOption = None) -> None:
    """A learning daemon at 100 kHz, its Python paused at random: does memory grow, are samples lost?"""
    out = out or Path("build/soak")
    with tempfile.TemporaryDirectory(prefix="soak-") as folder:
        frame = frame_of(soak_rows(Path(folder), minutes))
    settled = frame[int(SETTLED * len(frame)) :]
    if len(settled) >= FEWEST:  # by a straight line through it
        frame["growth"] = float(np.polyfit(settled["minute"] / 60.0, settled["memory_mib"], 1)[0])
    conclude(frame, SOAK_BARS, {"soak": table(frame, "label", SOAK_COLUMNS)}, out)
