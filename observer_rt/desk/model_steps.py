"""Steps from model to model of a bench, noted beside its bench file."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.outputs import write_text

HISTORY = ".taken_over.json"  # behind the name of the bench file


class UnacceptedChangesError(UserError):
    """An amended file changes more than it adds, and nobody has accepted that."""

    def __init__(self, amended: Path, changes: Sequence[str], present: Path) -> None:
        super().__init__(
            str(amended),
            f"would also change what {present.name} states: {'; '.join(changes)}",
            "were these corrected since the evidence was kept? search again with newer evidence, or accept them",
        )


@dataclass(frozen=True)
class TakeOver:
    """One step: the file that the bench named before (None: none) and after, of which injector, and when.

    learned_from: kept events that were learned from beforehand, with the model after.
    """

    injector: str
    before: str | None
    after: str
    time: str
    learned_from: int = 0

    @property
    def as_text(self) -> str:
        """What the bench names now, and what is known with it."""
        learned = (
            f", with what {self.learned_from} events of the evidence taught it" if self.learned_from else ""
        )
        return f"{self.after}{learned}"


def steps(path: Path) -> list[TakeOver]:
    """Steps that were not undone, the oldest first."""
    history = path.with_name(path.name + HISTORY)
    if not history.exists():
        return []
    with file_errors(history):
        try:
            return [TakeOver(**step) for step in json.loads(history.read_text(encoding="utf-8"))]
        except (ValueError, TypeError):
            raise UserError(str(history), "is no history of models taken over", "move it away") from None


def note_steps(path: Path, done: Sequence[TakeOver]) -> None:
    """Note the steps that were taken."""
    history = path.with_name(path.name + HISTORY)
    if not done:
        with file_errors(history):
            history.unlink(missing_ok=True)
        return
    write_text(history, json.dumps([asdict(step) for step in done], indent=2) + "\n")
