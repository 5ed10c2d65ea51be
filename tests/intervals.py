"""A sample interval and its inputs, as `advance_state` of the core takes them."""

from collections.abc import Sequence
from typing import NamedTuple


class Interval(NamedTuple):
    """Interval from sample to sample; inputs u = [p_R, A_S] by (24), linear in between, maybe with the time [s]."""

    start: Sequence[float]  # u
    end: Sequence[float]
    length: float  # s
    substeps: int  # RK4 steps at most
