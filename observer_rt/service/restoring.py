"""What was learned before, from a state file."""

from collections.abc import Callable
from pathlib import Path

from observer_rt.observer.learning.knowledge import Knowledge
from observer_rt.service.state_file import load_knowledge


def restored_knowledge(
    path: Path | None,
    model: str,
    pressure_scale: float,
    tell: Callable[[str], None],
    set_aside: bool = True,
) -> Knowledge | None:
    """What a state file holds for this model, telling what became of it; None without one.

    A state learned from no event is no reason to trust the first results sooner: it counts as none.
    """
    if path is None:
        return None
    restored = load_knowledge(path, model, pressure_scale, set_aside)
    tell(restored.message)
    return restored.knowledge if restored.knowledge and restored.knowledge.events else None
