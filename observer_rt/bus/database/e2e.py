"""AUTOSAR end-to-end protection at the start of a frame: profiles 5 and 7 (CAN FD), 1 and 2 (classic CAN).

Profile 5. Bytes 0-1: CRC-16/CCITT-FALSE (polynomial 0x1021, start 0xFFFF), little-endian, over byte 2 to the end
of the frame and then over the data id of the message, low byte first. Byte 2: counter 0 to 255.

Profile 1, variant 1A. Byte 0: CRC-8 (polynomial 0x1D, start 0), over the data id, low byte first, and then over
byte 1 to the end of the frame. Byte 1, low four bits: counter 0 to 14; the high four bits are free.

Profile 2. Byte 0: CRC-8H2F (polynomial 0x2F, start and final inversion 0xFF) over byte 1 to the end of the frame and
then over one of the message's 16 data ids: its place in the list is the counter. Byte 1, low four bits: counter 0 to
15; the high four bits are free.

Profile 7, its header at the start, high bytes first. Bytes 0-7: CRC-64/XZ (polynomial 0x42F0E1EBA9EA3693 reflected,
start and final inversion all ones) over byte 8 to the end. Bytes 8-11: length of the frame, 12-15: counter, 16-19:
data id.

The receiver's state machine (AUTOSAR E2E_SM) judges the frames of a message together.
"""

from enum import IntEnum

import numpy as np

from observer_rt.core.frames.frames import RECORDS
from observer_rt.foundation.records import dtype_of

UNPROTECTED = 0
PROFILE_1 = 1
PROFILE_2 = 2
PROFILE_5 = 5
PROFILE_7 = 7
PROFILES = (PROFILE_1, PROFILE_2, PROFILE_5, PROFILE_7)
DATA_IDS = 16  # of profile 2, one for every value of its counter

PROTECTION = dtype_of(RECORDS["Protection"])

SUPERVISION = dtype_of(RECORDS["Supervision"])


def protection_of(profile: int | None, data_id: int | bytes | None) -> np.void:
    """Protection of a message, a row `PROTECTION`; data_id: of profile 2 all of them."""
    row = np.zeros(1, PROTECTION)
    row["profile"] = profile or UNPROTECTED
    if isinstance(data_id, bytes):
        row["data_ids"] = np.frombuffer(data_id, np.uint8)
    else:
        row["data_id"] = data_id or 0
    found: np.void = row[0]
    return found


class E2EStatus(IntEnum):
    """Check result of one frame of a protected message."""

    OK = 0
    OK_SOME_LOST = 1
    REPEATED = 2
    WRONG_SEQUENCE = 3
    CRC_ERROR = 4
    LENGTH_ERROR = 5
    INITIAL = 6


class E2EState(IntEnum):
    """State of the receiver's state machine, over the frames of a protected message."""

    NODATA = 0
    INIT = 1
    VALID = 2
    INVALID = 3
