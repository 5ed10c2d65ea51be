"""AUTOSAR end-to-end protection at the start of a frame: profiles 5 (CAN FD) and 1 (classic CAN).

Profile 5. Bytes 0-1: CRC-16/CCITT-FALSE (polynomial 0x1021, start 0xFFFF), little-endian, over byte 2 to the end
of the frame and then over the data id of the message, low byte first. Byte 2: counter 0 to 255.

Profile 1, variant 1A. Byte 0: CRC-8 (polynomial 0x1D, start 0), over the data id, low byte first, and then over
byte 1 to the end of the frame. Byte 1, low four bits: counter 0 to 14; the high four bits are free.

The receiver's state machine (AUTOSAR E2E_SM) judges the frames of a message together.
"""

from enum import IntEnum

import numpy as np

from observer_rt.core.frames.frames import RECORDS
from observer_rt.foundation.records import dtype_of

UNPROTECTED = 0
PROFILE_1 = 1
PROFILE_5 = 5
PROFILES = (PROFILE_1, PROFILE_5)

PROTECTION = dtype_of(RECORDS["Protection"])

SUPERVISION = dtype_of(RECORDS["Supervision"])


def protection_of(profile: int | None, data_id: int | None) -> np.void:
    """Protection of a message, a row `PROTECTION`."""
    row = np.zeros(1, PROTECTION)
    row["profile"] = profile or UNPROTECTED
    row["data_id"] = data_id or 0
    protection: np.void = row[0]
    return protection


class E2EState(IntEnum):
    """State of the receiver's state machine, over the frames of a protected message."""

    NODATA = 0
    INIT = 1
    VALID = 2
    INVALID = 3
