"""Verdicts on closed events: posted by whoever judges, taken by the stream when an event is due.

Neither waits for the other, and no lock is between them: a finding counts for the event whose number it bears, and
its number is written last.
"""

from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from observer_rt.core.stream.stream import MOST_COEFFICIENTS, SLOTS
from observer_rt.engine.estimation.gain import GainSchedule
from observer_rt.engine.stream.phi import Phi
from observer_rt.model.network import HIDDEN, OUTPUTS


class Taken(IntEnum):
    """Which verdict the stream found when an event was due."""

    NOTHING = 0  # it was not judged
    EXAMINED = (
        1  # by the innovations of the live x~; with what was learned from an earlier one, if that is new
    )
    LEARNED = 2  # with what was learned from it


_FINDING = np.dtype(
    [
        ("number", np.int64),  # of the event it is on, from 1 in the order in which they closed
        ("reason", np.int8),  # Reason it did not pass, 0 when it did
        ("is_coloured", np.bool_),  # the innovations are, by what is known of the noise
        ("at_rest", np.float64),  # mean square of coloured ones with the needle shut, nan: as it was
    ],
    align=True,
)


CARRIED = np.dtype(
    [
        ("output", np.float64, (OUTPUTS, HIDDEN)),
        ("bias", np.float64, (OUTPUTS,)),
        ("back_pressure", np.float64, (2,)),
        ("learned_offset", np.float64),
        ("lag", np.float64),  # s
        ("line", np.float64, (MOST_COEFFICIENTS,)),  # its coefficients with what was learned of it
        # where the flow is known well enough: rail pressures, and p_S / p_L
        ("rail_from", np.float64),
        ("rail_to", np.float64),
        ("filled_to", np.float64),
    ],
    align=True,
)
"""Theta as the loop carries it."""

_VERDICT = np.dtype(
    [
        ("examined", _FINDING),
        ("learned", _FINDING),
        (
            "earlier",
            np.int64,
        ),  # the event's number, if what was learned from one before is to take force with it
        # what was learned
        ("is_adopted", np.bool_),
        ("innovation_sigma", np.float64),
        ("noise", np.float64, (3,)),  # of the channels
        ("carried", CARRIED),
    ],
    align=True,
)


class Verdicts(NamedTuple):
    """Two times SLOTS; the one on the n-th event is in slot n % SLOTS, what an earlier one taught SLOTS further."""

    slots: NDArray[np.void]
    gains: NDArray[np.float64]  # (2 SLOTS, n, states) gain schedules
    theta: NDArray[np.float64]  # (2 SLOTS, m)
    phi: Phi  # arrays as of what x^ carries, with a first dimension 2 SLOTS


def no_verdicts(parameters: int, schedule: GainSchedule, phi: Phi) -> Verdicts:
    """Slots for an observer that carries so many parameters, such a schedule and such a phi."""
    held: Any = phi
    return Verdicts(
        np.zeros(2 * SLOTS, _VERDICT),
        np.zeros((2 * SLOTS, *schedule.gains.shape)),
        np.zeros((2 * SLOTS, parameters)),
        type(held)(*(np.zeros((2 * SLOTS, *array.shape)) for array in held)),
    )
