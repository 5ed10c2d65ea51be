"""Hints for misspelt names."""

from collections.abc import Iterable
from difflib import get_close_matches


def nearest_name(name: str, known: Iterable[str]) -> str:
    """A hint for a message, `; the nearest is 'X'`, or nothing when no known name is near."""
    near = get_close_matches(name, list(known), n=1)
    return f"; the nearest is '{near[0]}'" if near else ""
