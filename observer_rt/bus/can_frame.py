"""CAN frames, classic and FD: their lengths, keys that name them on all buses, and the time one takes on a bus."""

from bisect import bisect_left

CLASSIC_LENGTH = 8  # bytes, the most a classic frame carries
FD_LENGTHS: tuple[int, ...] = (*range(CLASSIC_LENGTH + 1), 12, 16, 20, 24, 32, 48, 64)  # bytes, by code
STANDARD_MASK, EXTENDED_MASK = 0x7FF, 0x1FFF_FFFF  # of identifiers

# Of the generic Linux interface.
CLASSIC_MTU = 16  # bytes of struct can_frame, whatever the frame carries
FD_MTU = 72  # and of struct canfd_frame
HEADER_BYTES = 8  # of both, before the data
EXTENDED_FLAG, REMOTE_FLAG, ERROR_FLAG = 0x8000_0000, 0x4000_0000, 0x2000_0000  # in their identifier
BIT_RATE_SWITCH, ERROR_STATE = 0x01, 0x02  # Flags of struct canfd_frame: data sent faster, sender error passive.
ARPHRD_CAN = 280  # kind of interface

EXTENDED = 1 << 32  # Added to the id of a frame.
BUS = 1 << 33  # for each bus before its own
# A stuff bit follows five equal bits: after the first of a run (perhaps a stuff bit) come 2^5 - 2 bits on average.
BITS_PER_STUFF_BIT = 30.0

# Lengths in bits, ISO 11898-1.
_CLASSIC_HEAD = 19  # start 1, identifier 11, RTR 1, IDE 1, r0 1, DLC 4
_CLASSIC_HEAD_EXTENDED = 39  # start 1, identifier 11 + 18, SRR 1, IDE 1, RTR 1, r1 r0 2, DLC 4
_CLASSIC_CRC = 15
_CLASSIC_TAIL = 13  # CRC delimiter 1, ACK 1, ACK delimiter 1, end of frame 7, intermission 3
_FD_HEAD = 17  # start 1, identifier 11, RRS 1, IDE 1, FDF 1, res 1, BRS 1
_FD_HEAD_EXTENDED = 36  # start 1, identifier 11 + 18, SRR 1, IDE 1, RRS 1, FDF 1, res 1, BRS 1
_FD_CONTROL = 5  # ESI 1, DLC 4
_FD_STUFF_COUNT = 4  # Gray code 3, parity 1
_FD_SHORT_CRC = 17  # up to 16 bytes
_FD_LONG_CRC = 21
_FD_CRC_DELIMITER = 1
_FD_TAIL = 12  # ACK 1, ACK delimiter 1, end of frame 7, intermission 3


def length_code(length: int) -> int:
    """Data length code of the shortest frame that holds `length` bytes, of at most 64."""
    return bisect_left(FD_LENGTHS, length)


def length_of(code: int) -> int:
    """Bytes in a CAN FD frame of a data length code."""
    return FD_LENGTHS[min(code, len(FD_LENGTHS) - 1)]


def frame_key(frame_id: int, is_extended: bool, bus: int = 0) -> int:
    """Number for id and format of a frame on a bus."""
    return frame_id + (EXTENDED if is_extended else 0) + BUS * bus


def frame_time(length: int, is_fd: bool, bit_rate: float, data_bit_rate: float, is_extended: bool) -> float:
    """Time [s] a frame of `length` data bytes occupies the bus, intermission included; bit rates in bit/s.

    CAN FD frames switch to `data_bit_rate`; a length CAN FD does not have takes its next one. Raises `ValueError`: no
    frame of this kind holds `length` bytes.
    """
    if not 0 <= length <= (FD_LENGTHS[-1] if is_fd else CLASSIC_LENGTH):
        raise ValueError(f"no {'CAN FD' if is_fd else 'classic CAN'} frame holds {length} bytes")
    if not is_fd:
        stuffed = (_CLASSIC_HEAD_EXTENDED if is_extended else _CLASSIC_HEAD) + 8 * length + _CLASSIC_CRC
        return (_with_stuffing(stuffed) + _CLASSIC_TAIL) / bit_rate
    padded_length = length_of(length_code(length))
    head = _FD_HEAD_EXTENDED if is_extended else _FD_HEAD
    checksum = _FD_STUFF_COUNT + (_FD_SHORT_CRC if padded_length <= 16 else _FD_LONG_CRC)
    fixed_stuff_bits = -(-checksum // 4)  # one before the stuff count and one after every four bits
    fast = _with_stuffing(_FD_CONTROL + 8 * padded_length) + checksum + fixed_stuff_bits + _FD_CRC_DELIMITER
    return (_with_stuffing(head) + _FD_TAIL) / bit_rate + fast / data_bit_rate


def _with_stuffing(bits: int) -> float:
    return bits * (1.0 + 1.0 / BITS_PER_STUFF_BIT)
