"""The process that hides, on real lines. Imports nothing of `observer_rt`.

python -m tools.benchmarks.discovery.real_line.generator seal FOLDER < plan
python -m tools.benchmarks.discovery.real_line.generator healthy FOLDER RIG TARGET
python -m tools.benchmarks.discovery.real_line.generator record FOLDER LABEL TARGET

The first draws all cases into FOLDER, the others write to TARGET what the fit of a rig
is given, or a case's recordings, and print the files.
"""

import json
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tools.benchmarks.discovery.generator import LABELS, SEALED, write_recording
from tools.benchmarks.discovery.real_line.cases import (
    Kind,
    Numbers,
    RealCase,
    Rig,
    given_benches,
    healthy_benches,
    make_cases,
)
from tools.benchmarks.discovery.real_line.discrepancies import Discrepancy
from tools.benchmarks.plant import Bench


@dataclass(frozen=True)
class RealPlan:
    """What is drawn: numbers of cases, without and with measured rate, on which plants, seed, and what alone."""

    numbers: Numbers
    rates: tuple[bool, ...]
    discrepancies: tuple[str, ...]
    master_seed: int
    chosen: tuple[str, ...] = ()


@dataclass(frozen=True)
class Label:
    """What may be known of a case before it is opened: its rig, whose fitted model it is asked with."""

    label: str
    rig: Rig


def seal(plan: RealPlan, folder: Path) -> None:
    """Draw the cases: what is hidden goes to SEALED, opened after the answers, labels and rigs to LABELS."""
    folder.mkdir(parents=True, exist_ok=True)
    discrepancies = [Discrepancy(name) for name in plan.discrepancies]
    cases = make_cases(plan.numbers, plan.rates, discrepancies, plan.master_seed, plan.chosen)
    (folder / SEALED).write_text(json.dumps([asdict(case) for case in cases], indent=1))
    labels = [asdict(Label(case.label, case.rig)) for case in cases]
    (folder / LABELS).write_text(json.dumps(labels))


def opened(folder: Path) -> tuple[RealCase, ...]:
    """What was hidden; for after the answers, and for the generator itself."""
    return tuple(_case(entry) for entry in json.loads((folder / SEALED).read_text()))


def labels_of(folder: Path) -> tuple[Label, ...]:
    """What is not sealed."""
    entries = json.loads((folder / LABELS).read_text())
    return tuple(Label(entry["label"], Rig(**entry["rig"])) for entry in entries)


def write_all(benches: Iterable[Bench], with_rate: bool, folder: Path) -> tuple[Path, ...]:
    """Recordings as CSV files, named by nothing but their order."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for number, bench in enumerate(benches, start=1):
        files.append(folder / f"recording_{number}.csv")
        write_recording(files[-1], bench, with_rate)
    return tuple(files)


def _case(entry: dict[str, Any]) -> RealCase:
    parts = tuple((name, tuple(values)) for name, values in entry["parts"])
    return RealCase(entry["label"], Kind(entry["kind"]), parts, Rig(**entry["rig"]), entry["seed"])


def _plan(entry: dict[str, Any]) -> RealPlan:
    lists = {key: tuple(entry[key]) for key in ("rates", "discrepancies", "chosen")}
    return RealPlan(Numbers(**entry["numbers"]), master_seed=entry["master_seed"], **lists)


def main(arguments: Sequence[str]) -> None:
    """Entry point."""
    verb, folder = arguments[0], Path(arguments[1])
    if verb == "seal":
        seal(_plan(json.load(sys.stdin)), folder)
        return
    sealed, name, target = folder, arguments[2], Path(arguments[3])
    if verb == "healthy":
        rig = next(label.rig for label in labels_of(sealed) if label.rig.name == name)
        files = write_all(healthy_benches(rig), rig.with_rate, target)
    else:
        case = next(case for case in opened(sealed) if case.label == name)
        files = write_all(given_benches(case), case.rig.with_rate, target)
    for file in files:
        print(file)


if __name__ == "__main__":
    main(sys.argv[1:])
