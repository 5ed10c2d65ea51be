"""The process that hides, outside the vocabulary. Imports nothing of `observer_rt`.

python -m tools.benchmarks.discovery.outside.generator seal FOLDER < plan     draws all cases
python -m tools.benchmarks.discovery.outside.generator record FOLDER LABEL    writes a case's recordings

What is given goes to FOLDER/LABEL/given; to FOLDER/LABEL/further what is not: the plant without noise, with its true
rate, for the gap of whatever model comes of an answer.
"""

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from tools.benchmarks.discovery.generator import LABELS, SEALED
from tools.benchmarks.discovery.outside.cases import (
    Asked,
    OutsideCase,
    OutsidePlan,
    further_benches,
    given_benches,
    make_cases,
)
from tools.benchmarks.discovery.real_line.cases import Rig
from tools.benchmarks.discovery.real_line.generator import write_all

SAME_TO_RECORDINGS = ({"bulk_modulus", "line_volume"},)
"""Names of the vocabulary that are one to any recording, and are taken away together."""
GIVEN, FURTHER = "given", "further"  # folders of a case


@dataclass(frozen=True)
class OutsideLabel:
    """What may be known of a case before it is opened: its plant, and the names that are taken away."""

    label: str
    rig: Rig | None
    without: tuple[str, ...]


def seal(plan: OutsidePlan, folder: Path) -> None:
    """Draw the cases: what is hidden goes to SEALED, opened after the answers, the rest to LABELS."""
    folder.mkdir(parents=True, exist_ok=True)
    cases = make_cases(plan)
    (folder / SEALED).write_text(json.dumps([asdict(case) for case in cases], indent=1))
    labels = [asdict(OutsideLabel(case.label, case.rig, taken_away(case))) for case in cases]
    (folder / LABELS).write_text(json.dumps(labels))


def taken_away(case: OutsideCase) -> tuple[str, ...]:
    """Names the vocabulary is asked without."""
    if case.asked is not Asked.LEFT_OUT:
        return ()
    return tuple(sorted(next((same for same in SAME_TO_RECORDINGS if case.name in same), {case.name})))


def opened(folder: Path) -> tuple[OutsideCase, ...]:
    """What was hidden; for after the answers, and for the generator itself."""
    return tuple(
        OutsideCase(
            **entry
            | {"asked": Asked(entry["asked"]), "values": tuple(entry["values"]), "rig": _rig(entry["rig"])}
        )
        for entry in json.loads((folder / SEALED).read_text())
    )


def labels_of(folder: Path) -> tuple[OutsideLabel, ...]:
    """What is not sealed."""
    entries = json.loads((folder / LABELS).read_text())
    return tuple(OutsideLabel(e["label"], _rig(e["rig"]), tuple(e["without"])) for e in entries)


def _rig(entry: dict[str, int | bool] | None) -> Rig | None:
    return None if entry is None else Rig(int(entry["number"]), bool(entry["with_rate"]), int(entry["seed"]))


def record_case(case: OutsideCase, folder: Path) -> None:
    """The recordings of a case, named by nothing but their order."""
    write_all(given_benches(case), case.with_rate, folder / GIVEN)
    write_all(further_benches(case), True, folder / FURTHER)


def main(arguments: Sequence[str]) -> None:
    """Entry point."""
    verb, folder = arguments[0], Path(arguments[1])
    if verb == "seal":
        entry = json.load(sys.stdin)
        lists = {key: tuple(entry[key]) for key in ("rates", "discrepancies", "names")}
        seal(OutsidePlan(**(entry | lists)), folder)
    else:
        record_case(
            next(case for case in opened(folder) if case.label == arguments[2]), folder / arguments[2]
        )


if __name__ == "__main__":
    main(sys.argv[1:])
