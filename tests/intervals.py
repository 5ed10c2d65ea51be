"""A sample interval and its inputs, as `advance_state` of the core takes them."""

from typing import NamedTuple


class Interval(NamedTuple):
    """Interval from one sample to the next; inputs u = [p_R, A_S] normalised by (24), linear in between."""

    start: tuple[float, float]  # u
    end: tuple[float, float]
    length: float  # s
    substeps: int  # RK4 steps at most
