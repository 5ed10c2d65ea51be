"""What hides cases outside the vocabulary, as `discovery.hiding` says. Imports nothing of `observer_rt`.

What is given goes to TARGET/given; to TARGET/further what is not: the plant without noise, with its true rate, for
the gap of whatever model comes of an answer.
"""

import sys
from pathlib import Path

from pydantic import TypeAdapter

from tools.benchmarks.discovery.generator import write_all
from tools.benchmarks.discovery.hiding import Hiding
from tools.benchmarks.discovery.outside.cases import (
    Asked,
    OutsideCase,
    OutsidePlan,
    further_benches,
    given_benches,
    make_cases,
)
from tools.benchmarks.discovery.real_line.generator import RigLabel

SAME_TO_RECORDINGS = ({"bulk_modulus", "line_volume"},)
"""Names of the vocabulary that are one to any recording, and are taken away together."""
GIVEN, FURTHER = "given", "further"  # folders of a case


def taken_away(case: OutsideCase) -> tuple[str, ...]:
    """Names the vocabulary is asked without."""
    if case.asked is not Asked.LEFT_OUT:
        return ()
    return tuple(sorted(next((same for same in SAME_TO_RECORDINGS if case.name in same), {case.name})))


def record_case(case: OutsideCase, target: Path) -> tuple[Path, ...]:
    """The recordings of a case."""
    given = write_all(given_benches(case), case.with_rate, target / GIVEN)
    return given + write_all(further_benches(case), True, target / FURTHER)


HIDING = Hiding(
    plan=TypeAdapter(OutsidePlan),
    cases=TypeAdapter(tuple[OutsideCase, ...]),
    labels=TypeAdapter(tuple[RigLabel, ...]),
    make=make_cases,
    label_of=lambda case: RigLabel(case.label, case.rig, taken_away(case)),
    record=record_case,
)

if __name__ == "__main__":
    HIDING.run(sys.argv[1:])
