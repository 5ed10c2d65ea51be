"""Time that a CAN frame occupies the bus, by the lengths of its fields and the stuff bits to be expected."""

from observer_rt.bus.can_frame import CLASSIC_LENGTH, FD_LENGTHS, length_code, length_of

# A stuff bit follows five equal bits. From the first bit of a run (the stuff bit itself begins one) it takes
# on average 2^5 - 2 random bits to see four more of the same.
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


def frame_time(length: int, is_fd: bool, bit_rate: float, data_bit_rate: float, is_extended: bool) -> float:
    """Time [s] one frame of `length` data bytes occupies the bus, intermission included.

    `bit_rate` and `data_bit_rate` in bit/s; the latter counts for CAN FD only, whose frames are sent with the
    bit rate switched. A length CAN FD does not have takes the next one that it has.

    Raises `ValueError`: no frame of this kind holds `length` bytes.
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
