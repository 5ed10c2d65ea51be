"""Samples as they are recorded, one after another: what alignment and observer share.

The alignment writes them, in order, into a ring; the observer takes them from there.
"""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

RECORDED_RING = 1 << 13  # samples: those decided at once, and those of which later ones must be known

RECORDED = np.dtype(
    [
        ("index", np.int64),
        ("values", np.float64, (3,)),  # rail pressure [Pa], needle lift [m], line pressure [Pa]
        (
            "shares",
            np.float64,
            (3,),
        ),  # 0..1, by which it lies between two of its channel; of a lift, how much later
        ("interpolated", np.bool_),
        ("broken", np.int8),  # Break
        ("doubt", np.int8),  # Doubt
    ],
    align=True,
)


def make_recorded() -> NDArray[np.void]:
    """An empty ring of recorded samples."""
    return np.zeros(RECORDED_RING, RECORDED)


class Break(IntEnum):
    """Why a sample does not follow its predecessor."""

    NONE = 0
    START = 1  # the first sample
    JUMP = 2  # legal jump of a windowed source
    LOSS = 3  # samples were lost
    RESTART = 4  # the device's index began anew


class Doubt(IntEnum):
    """Why a sample cannot be trusted although it is there; numbers are those of `stream.state.Reason`."""

    NONE = 0
    TIME_BASE = 16  # when it was taken is not known well enough
    FROZEN = 24  # an input keeps its value for longer than can be bridged
    CLIPPED = 25  # an input stays at the end of its range
