"""Verdicts on closed events: posted by whoever judges, taken by the stream when an event is due.

Neither waits for the other, and no lock is between them: a finding counts for the event whose number it bears, and
its number is written last.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.stream.stream import RECORDS, SLOTS
from observer_rt.engine.estimation.gain import GainSchedule
from observer_rt.foundation.records import dtype_of

_VERDICT = dtype_of(RECORDS["Verdict"])


class VerdictKind(IntEnum):
    """Verdict that the stream found when an event was due."""

    NOTHING = 0  # it was not judged
    # By the innovations of the live x~; with what was learned from an earlier one, if that is new.
    EXAMINED = 1
    LEARNED = 2  # with what was learned from it


class Verdicts(NamedTuple):
    """Two times SLOTS; the one on the n-th event is in slot n % SLOTS, what an earlier one taught SLOTS further."""

    slots: NDArray[np.void]
    gains: NDArray[np.float64]  # (2 SLOTS, n, states) gain schedules
    theta: NDArray[np.float64]  # (2 SLOTS, m)


def no_verdicts(parameters: int, schedule: GainSchedule) -> Verdicts:
    """Slots for an observer that carries so many parameters and such a schedule."""
    return Verdicts(
        np.zeros(2 * SLOTS, _VERDICT),
        np.zeros((2 * SLOTS, *schedule.gains.shape)),
        np.zeros((2 * SLOTS, parameters)),
    )
