"""News of an input."""

from dataclasses import dataclass


@dataclass(frozen=True)
class WatchFinding:
    """What is wrong, with a remedy where there is one; `is_over`: it is well again."""

    text: str
    is_over: bool = False
