"""What hides cases on real lines, as `discovery.hiding` says. Imports nothing of `observer_rt`.

One verb more, python -m tools.benchmarks.discovery.real_line.generator healthy FOLDER RIG TARGET, writes what the fit
of a rig is given.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter

from tools.benchmarks.discovery.generator import write_all
from tools.benchmarks.discovery.hiding import Hiding
from tools.benchmarks.discovery.real_line.cases import (
    Numbers,
    RealCase,
    Rig,
    given_benches,
    healthy_benches,
    make_cases,
)
from tools.benchmarks.discovery.real_line.discrepancies import Discrepancy


@dataclass(frozen=True)
class RealPlan:
    """What is drawn: numbers of cases, without and with measured rate, on which plants, seed, and what alone."""

    numbers: Numbers
    rates: tuple[bool, ...]
    discrepancies: tuple[Discrepancy, ...]
    master_seed: int
    chosen: tuple[str, ...] = ()


@dataclass(frozen=True)
class RigLabel:
    """What may be known of a case before it is opened: its rig, whose fitted model it is asked with.

    None: the nominal injector; without: names the vocabulary is asked without.
    """

    label: str
    rig: Rig | None
    without: tuple[str, ...] = ()


HIDING = Hiding(
    plan=TypeAdapter(RealPlan),
    cases=TypeAdapter(tuple[RealCase, ...]),
    labels=TypeAdapter(tuple[RigLabel, ...]),
    make=lambda plan: make_cases(plan.numbers, plan.rates, plan.discrepancies, plan.master_seed, plan.chosen),
    label_of=lambda case: RigLabel(case.label, case.rig),
    record=lambda case, target: write_all(given_benches(case), case.rig.with_rate, target),
)


def main(arguments: Sequence[str]) -> None:
    """Entry point."""
    if arguments[0] != "healthy":
        HIDING.run(arguments)
        return
    sealed, name, target = Path(arguments[1]), arguments[2], Path(arguments[3])
    rigs = (label.rig for label in HIDING.labels_in(sealed) if label.rig is not None)
    rig = next(rig for rig in rigs if rig.name == name)
    for file in write_all(healthy_benches(rig), rig.with_rate, target):
        print(file)


if __name__ == "__main__":
    main(sys.argv[1:])
