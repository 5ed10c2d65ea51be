"""What hides cases on lines of the nominal structure, as `hiding` says. Imports nothing of `observer_rt`."""

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from tools.benchmarks.discovery.cases import GIVEN, HiddenCase, benches, make_cases, measured_rate
from tools.benchmarks.discovery.hiding import Hiding
from tools.benchmarks.plant import Bench, record

MEGAPASCAL, MILLIMETRE, MM3_PER_MS = 1e6, 1e-3, 1e-6
HEADER = "time_s,rail_pressure_MPa,needle_lift_mm,line_pressure_MPa"


@dataclass(frozen=True)
class HidingPlan:
    """What is drawn: numbers of cases, effects, without and with measured rate, seed."""

    effects: tuple[str, ...]
    faulty: int
    healthy: int
    rates: tuple[bool, ...]
    master_seed: int


def write_recordings(case: HiddenCase, folder: Path) -> tuple[Path, ...]:
    """The recordings of a case."""
    return write_all(benches(case, GIVEN), case.with_rate, folder)


def write_all(benches: Iterable[Bench], with_rate: bool, folder: Path) -> tuple[Path, ...]:
    """Recordings as CSV files, named by nothing but their order."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for number, bench in enumerate(benches, start=1):
        files.append(folder / f"recording_{number}.csv")
        write_recording(files[-1], bench, with_rate)
    return tuple(files)


def write_recording(path: Path, bench: Bench, with_rate: bool) -> None:
    """What a bench records, as CSV file."""
    outcome = record(bench)
    measured = outcome.measured
    columns: list[NDArray[np.float64]] = [
        measured.time,
        measured.rail_pressure / MEGAPASCAL,
        measured.needle_lift / MILLIMETRE,
        measured.line_pressure / MEGAPASCAL,
    ]
    header, row = HEADER, "%.5f,%.3f,%.5f,%.3f"
    if with_rate:
        columns.append(measured_rate(bench, outcome) / MM3_PER_MS)
        header, row = f"{header},injection_rate_mm3_per_ms", f"{row},%.5f"
    lines = [row % values for values in zip(*(c.tolist() for c in columns), strict=True)]
    path.write_text("\n".join([header, *lines]) + "\n")


HIDING = Hiding(
    plan=TypeAdapter(HidingPlan),
    cases=TypeAdapter(tuple[HiddenCase, ...]),
    labels=TypeAdapter(tuple[str, ...]),
    make=lambda plan: make_cases(plan.effects, plan.faulty, plan.healthy, plan.rates, plan.master_seed),
    label_of=lambda case: case.label,
    record=write_recordings,
)

if __name__ == "__main__":
    HIDING.run(sys.argv[1:])
