"""Learned states that a user names: read to begin with, written at the end."""

from pathlib import Path

from observer_rt.daemon.persistence.keeper import sole_writer
from observer_rt.daemon.persistence.state_file import save_knowledge
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.foundation.errors import UserError
from observer_rt.model.parameters import InjectorParameters


def refuse_missing_state(place: str, path: Path | None) -> None:
    """Raise `UserError` at `place` for a state that is named and not there."""
    if path is not None and not path.exists():
        raise UserError(f"{place} {path}", "no such file", "correct the path, or leave it out")


def write_state(path: Path, knowledge: Knowledge, parameters: InjectorParameters) -> None:
    """Write what was learned with a model, as its file states it; no daemon may keep the file.

    Raises `UserError`, `RunError` where it cannot be written.
    """
    with sole_writer(path):
        save_knowledge(path, knowledge, parameters)
