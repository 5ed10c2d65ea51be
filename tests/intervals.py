"""A sample interval and its inputs, as `advance_state` of the core takes them."""

from collections.abc import Sequence
from typing import NamedTuple


class Interval(NamedTuple):
    """Interval from one sample to the next; inputs u = [p_R, A_S] normalised by (24), linear in between.

    With the time since the needle opened [s] behind them, or without.
    """

    start: Sequence[float]  # u
    end: Sequence[float]
    length: float  # s
    substeps: int  # RK4 steps at most
