"""Recorded samples, one after another: the alignment writes them into a ring, the observer takes them from there."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.stream.stream import RECORDED_RING, RECORDS
from observer_rt.foundation.records import dtype_of

RECORDED = dtype_of(RECORDS["Recorded"])


def make_recorded() -> NDArray[np.void]:
    """An empty ring of recorded samples."""
    return np.zeros(RECORDED_RING, RECORDED)
