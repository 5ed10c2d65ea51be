"""One number that names a frame on all buses of a bench, and what a received frame is checked by."""

import numpy as np
from numpy.typing import NDArray

from observer_rt.bus.can_frame import length_code, length_of
from observer_rt.bus.database.e2e import UNPROTECTED
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.mapping.input_tables import INPUT_MESSAGE

# Added to the id of a frame.
EXTENDED = 1 << 32
BUS = 1 << 33  # for each bus before its own


def frame_key(frame_id: int, is_extended: bool, bus: int = 0) -> int:
    """One number for id and format of a frame on a bus."""
    return frame_id + (EXTENDED if is_extended else 0) + BUS * bus


def frame_row(layout: MessageLayout) -> NDArray[np.void]:
    """What tells whether a frame is a good one of this message, `INPUT_MESSAGE`; the rest is 0."""
    row = np.zeros((), INPUT_MESSAGE)
    row["key"] = frame_key(layout.frame_id, layout.is_extended, layout.bus)
    row["length"] = layout.length
    row["padded_length"] = length_of(length_code(layout.length))
    row["e2e_profile"] = layout.e2e_profile or UNPROTECTED
    row["data_id"] = layout.e2e_data_id or 0
    return row
