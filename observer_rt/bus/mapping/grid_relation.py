"""Relation of the samples of each input message to the grid of the alignment."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.config.bench import BenchInjector
from observer_rt.config.injector_sections import Meaning
from observer_rt.config.signals import Role, undone_in_alignment
from observer_rt.core.frames.frames import MAX_INTERPOLATED, Joining

_LINE_PRESSURE = 1 << ROLES.index(Role.LINE_PRESSURE)


class GridRelation(NamedTuple):
    """Relation of a message's samples to the grid, by which they are put between its samples (`resampling.pxi`)."""

    roles: int
    """Bits, by `ROLES`, of the roles that are put there; the message's others stay where they are."""
    spacing: float
    """Samples of the grid from one sample of the message to its next."""
    reach: float
    """Longest distance of two of its samples that is bridged [samples of the grid]."""
    holds: bool
    """Whether its last sample is held for as long; else what follows is missing."""
    early: float = 0.0
    """How much its values are earlier than its samples [samples of the grid]."""
    on_grid: bool = False
    """Whether its samples are at places of the grid; else they lie between them."""


def grid_relations(injector: BenchInjector, timing: NDArray[np.void], roles: list[int]) -> list[GridRelation | None]:
    """Relation of each message to the grid, None where all of it is on it; timing, roles (bits): of each message.

    The value of a mean is that of half a sample period earlier, a filtered value that of the stated delay earlier.
    The line pressure stays where it is: the model's is averaged and delayed instead.
    """
    config = injector.config
    rate = config.sampling.rate_hz
    result: list[GridRelation | None] = []
    for row, bits in zip(timing, roles, strict=True):
        others, spacing, is_slow = bits & ~_LINE_PRESSURE, float(row["steps"]), bool(row["steps"] > 1)
        reach = float(row["hold"]) * rate if is_slow else MAX_INTERPOLATED + 1.0
        delays = [undone_in_alignment(config.signals, role) for n, role in enumerate(ROLES) if others >> n & 1]
        early = max(delays, default=0.0) * rate + (0.5 * spacing if config.sampling.meaning is Meaning.MEAN else 0.0)
        if row["joining"] in (Joining.INDEX, Joining.NEAREST):
            follows = early != 0.0 and others != 0
            result.append(GridRelation(others, spacing, reach, False, early, True) if follows else None)
        else:
            result.append(GridRelation(bits, spacing, reach, is_slow, early))
    return result
