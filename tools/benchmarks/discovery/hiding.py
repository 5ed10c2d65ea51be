"""A process that hides: draws cases, seals what is hidden, records. Imports nothing of `observer_rt`.

python -m tools.benchmarks.discovery.hiding CASES VERB FOLDER ..., CASES the module that draws them, prints files:

seal FOLDER < plan             draws all cases into FOLDER
record FOLDER LABEL TARGET     writes a case's recordings to TARGET
healthy FOLDER RIG TARGET      writes what the fit of a rig is given
"""

import hashlib
import importlib
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, Protocol, TypeVar

from pydantic import TypeAdapter

SEALED, LABELS = "sealed.json", "labels.json"


class Sealed(Protocol):
    """A case; all but its label is hidden."""

    @property
    def label(self) -> str:
        """What it is known by until it is opened."""


def label_of(key: Sequence[int]) -> str:
    """A label that tells nothing of what determines a case."""
    return hashlib.sha256(repr(key).encode()).hexdigest()[:12]


Plan = TypeVar("Plan")
Case = TypeVar("Case", bound=Sealed)
Label = TypeVar("Label")


@dataclass(frozen=True)
class Hiding(Generic[Plan, Case, Label]):
    """What a module hides.

    make: all cases of a plan; label_of: what may be known of a case before it is opened; record: its recordings into
    a folder, named by nothing but their order; healthy: the same of the rig of a label, before anything is hidden.
    """

    plan: TypeAdapter[Plan]
    cases: TypeAdapter[tuple[Case, ...]]
    labels: TypeAdapter[tuple[Label, ...]]
    make: Callable[[Plan], tuple[Case, ...]]
    label_of: Callable[[Case], Label]
    record: Callable[[Case, Path], Iterable[Path]]
    healthy: Callable[[Sequence[Label], str, Path], Iterable[Path]] | None = None

    def seal(self, plan: Plan, folder: Path) -> None:
        """Draw the cases: what is hidden goes to SEALED, opened after the answers, the rest to LABELS."""
        folder.mkdir(parents=True, exist_ok=True)
        cases = self.make(plan)
        (folder / SEALED).write_bytes(self.cases.dump_json(cases, indent=1))
        (folder / LABELS).write_bytes(self.labels.dump_json(tuple(map(self.label_of, cases))))

    def opened(self, folder: Path) -> tuple[Case, ...]:
        """What was hidden; for after the answers, and for the process that records."""
        return self.cases.validate_json((folder / SEALED).read_bytes())

    def labels_in(self, folder: Path) -> tuple[Label, ...]:
        """What is not sealed."""
        return self.labels.validate_json((folder / LABELS).read_bytes())

    def run(self, arguments: Sequence[str]) -> None:
        """The process itself."""
        verb, folder, *rest = arguments
        if verb == "seal":
            self.seal(self.plan.validate_json(sys.stdin.read()), Path(folder))
            return
        name, target = rest
        if verb == "healthy" and self.healthy is not None:
            files = self.healthy(self.labels_in(Path(folder)), name, Path(target))
        else:
            files = self.record(next(c for c in self.opened(Path(folder)) if c.label == name), Path(target))
        for file in files:
            print(file)


if __name__ == "__main__":
    importlib.import_module(sys.argv[1]).HIDING.run(sys.argv[2:])
