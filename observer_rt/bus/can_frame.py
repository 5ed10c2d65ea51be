"""What a CAN frame can hold, classic and FD, and how Linux counts it."""

from bisect import bisect_left

CLASSIC_LENGTH = 8  # bytes, the most a classic frame carries
FD_LENGTHS: tuple[int, ...] = (
    *range(CLASSIC_LENGTH + 1),
    12,
    16,
    20,
    24,
    32,
    48,
    64,
)  # bytes, by code
STANDARD_MASK, EXTENDED_MASK = 0x7FF, 0x1FFF_FFFF  # of identifiers

# Of the generic Linux interface.
FD_MTU = 72  # bytes of struct canfd_frame, whatever the frame carries
ARPHRD_CAN = 280  # kind of interface


def length_code(length: int) -> int:
    """Data length code of the shortest frame that holds `length` bytes, of at most 64."""
    return bisect_left(FD_LENGTHS, length)


def length_of(code: int) -> int:
    """Bytes in a CAN FD frame of a data length code."""
    return FD_LENGTHS[min(code, len(FD_LENGTHS) - 1)]
