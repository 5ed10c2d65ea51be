"""Misspelt names: what was probably meant."""

from collections.abc import Iterable
from difflib import SequenceMatcher

CUTOFF = 0.4  # likeness below which two names have nothing to do with each other


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name most like `name`, whatever its case; None when none is like it."""

    def likeness(other: str) -> tuple[float, float]:
        ignoring_case = SequenceMatcher(None, name.lower(), other.lower()).ratio()
        return ignoring_case, SequenceMatcher(None, name, other).ratio()

    best = max(known, key=likeness, default=None)
    return best if best is not None and likeness(best)[0] >= CUTOFF else None


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """For the beginning of a remedy: `did you mean 'X'? `, or nothing when no known name is near."""
    best = nearest(name, known)
    return "" if best is None else f"did you mean '{best}'? "


def hint(name: str, known: Iterable[str]) -> str:
    """For the end of a message: `; the nearest is 'X'`, or nothing when no known name is near."""
    best = nearest(name, known)
    return "" if best is None else f"; the nearest is '{best}'"
