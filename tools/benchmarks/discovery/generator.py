"""The process that hides: draws the cases, seals what is hidden, writes recordings. Imports nothing of `observer_rt`.

python -m tools.benchmarks.discovery.generator seal FOLDER < plan     draws all cases
python -m tools.benchmarks.discovery.generator record FOLDER LABEL    writes a case's recordings, prints their files
"""

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tools.benchmarks.discovery.cases import GIVEN, HiddenCase, benches, make_cases, measured_rate
from tools.benchmarks.plant import Bench, record

SEALED, LABELS = "sealed.json", "labels.json"
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


def seal(plan: HidingPlan, folder: Path) -> None:
    """Draw the cases: what is hidden goes to SEALED, opened after the answers, the labels to LABELS."""
    folder.mkdir(parents=True, exist_ok=True)
    cases = make_cases(plan.effects, plan.faulty, plan.healthy, plan.rates, plan.master_seed)
    (folder / SEALED).write_text(json.dumps([asdict(case) for case in cases]))
    (folder / LABELS).write_text(json.dumps([case.label for case in cases]))


def opened(folder: Path) -> tuple[HiddenCase, ...]:
    """What was hidden; for after the answers, and for the generator itself."""
    return tuple(
        HiddenCase(**(entry | {"values": tuple(entry["values"])}))
        for entry in json.loads((folder / SEALED).read_text())
    )


def write_recordings(case: HiddenCase, folder: Path) -> tuple[Path, ...]:
    """The recordings of a case as CSV files, named by nothing but their order."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for number, bench in enumerate(benches(case, GIVEN), start=1):
        files.append(folder / f"recording_{number}.csv")
        write_recording(files[-1], bench, case.with_rate)
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


def main(arguments: Sequence[str]) -> None:
    """Entry point."""
    verb, folder = arguments[0], Path(arguments[1])
    if verb == "seal":
        entry = json.load(sys.stdin)
        seal(HidingPlan(**(entry | {key: tuple(entry[key]) for key in ("effects", "rates")})), folder)
    else:
        label = arguments[2]
        case = next(case for case in opened(folder) if case.label == label)
        for file in write_recordings(case, folder / label):
            print(file)


if __name__ == "__main__":
    main(sys.argv[1:])
