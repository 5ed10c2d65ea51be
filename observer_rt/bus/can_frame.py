"""CAN frames, classic and FD: their lengths, and the keys that name them on all buses."""

from bisect import bisect_left

CLASSIC_LENGTH = 8  # bytes, the most a classic frame carries
FD_LENGTHS: tuple[int, ...] = (*range(CLASSIC_LENGTH + 1), 12, 16, 20, 24, 32, 48, 64)  # bytes, by code
STANDARD_MASK, EXTENDED_MASK = 0x7FF, 0x1FFF_FFFF  # of identifiers

# Of the generic Linux interface.
CLASSIC_MTU = 16  # bytes of struct can_frame, whatever the frame carries
FD_MTU = 72  # and of struct canfd_frame
HEADER_BYTES = 8  # of both, before the data
EXTENDED_FLAG, REMOTE_FLAG, ERROR_FLAG = 0x8000_0000, 0x4000_0000, 0x2000_0000  # in their identifier
# Flags of struct canfd_frame: data sent faster, sender error passive.
BIT_RATE_SWITCH, ERROR_STATE = 0x01, 0x02
ARPHRD_CAN = 280  # kind of interface

# Added to the id of a frame.
EXTENDED = 1 << 32
BUS = 1 << 33  # for each bus before its own


def length_code(length: int) -> int:
    """Data length code of the shortest frame that holds `length` bytes, of at most 64."""
    return bisect_left(FD_LENGTHS, length)


def length_of(code: int) -> int:
    """Bytes in a CAN FD frame of a data length code."""
    return FD_LENGTHS[min(code, len(FD_LENGTHS) - 1)]


def frame_key(frame_id: int, is_extended: bool, bus: int = 0) -> int:
    """Number for id and format of a frame on a bus."""
    return frame_id + (EXTENDED if is_extended else 0) + BUS * bus
