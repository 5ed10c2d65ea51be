"""Candidate laws: what may be missing in an equation."""

import math
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class CandidateLaw:
    """A law that may be missing in the derivative of a state, times a coefficient.

    equation: the state; words: as it is printed, `{}` where it has a number of its own; law: of states and inputs,
    and of that number; numbers: at which it is tried, before it is fitted; lowest, highest: of the coefficient.
    """

    equation: str
    words: str
    law: Callable[..., float]
    numbers: tuple[float, ...] = ()
    lowest: float = -math.inf
    highest: float = math.inf
