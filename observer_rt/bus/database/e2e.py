"""AUTOSAR end-to-end protection at the start of a frame: profiles 5 and 7 (CAN FD), and profile 1 (classic CAN).

Profile 5. Bytes 0-1: CRC-16/CCITT-FALSE (polynomial 0x1021, start 0xFFFF), little-endian, over byte 2 to the end
of the frame and then over the data id of the message, low byte first. Byte 2: counter 0 to 255.

Profile 1, variant 1A. Byte 0: CRC-8 (polynomial 0x1D, start 0), over the data id, low byte first, and then over
byte 1 to the end of the frame. Byte 1, low four bits: counter 0 to 14; the high four bits are free.

Profile 7, its header at the start, high bytes first. Bytes 0-7: CRC-64/XZ (polynomial 0x42F0E1EBA9EA3693 reflected,
start and final inversion all ones) over byte 8 to the end. Bytes 8-11: length of the frame, 12-15: counter, 16-19:
data id.
"""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled, inner, separate

UNPROTECTED = 0
PROFILE_1 = 1
PROFILE_5 = 5
PROFILE_7 = 7
PROFILES = (PROFILE_1, PROFILE_5, PROFILE_7)
_CRC_BYTES = 2  # of profile 5
_COUNTER_BYTE = 2
_NIBBLE_BYTE = 1  # with the counter of profile 1
_LENGTH_7, _COUNTER_7, _DATA_ID_7, _HEADER_7 = (
    8,
    12,
    16,
    20,
)  # bytes of profile 7's header, its CRC before them


class E2EStatus(IntEnum):
    """What the receiver makes of one frame of a protected message."""

    OK = 0
    OK_SOME_LOST = 1
    REPEATED = 2
    WRONG_SEQUENCE = 3
    CRC_ERROR = 4
    LENGTH_ERROR = 5
    INITIAL = 6


def _crc_table(bits: int, polynomial: int) -> NDArray[np.int64]:
    remainder = np.arange(256) << bits - 8
    for _ in range(8):
        remainder = np.where(remainder >> bits - 1 & 1, remainder << 1 ^ polynomial, remainder << 1)
    return remainder & (1 << bits) - 1


CRC16_TABLE = _crc_table(16, 0x1021).astype(np.uint16)
CRC8_TABLE = _crc_table(8, 0x1D).astype(np.uint8)


def _reflected_table(polynomial: int) -> NDArray[np.uint64]:
    table = []
    for remainder in range(256):
        for _ in range(8):
            remainder = remainder >> 1 ^ (polynomial if remainder & 1 else 0)
        table.append(remainder)
    return np.array(table, np.uint64)


CRC64_TABLE = _reflected_table(0xC96C5795D7870F42)  # 0x42F0E1EBA9EA3693, its bits in reverse


@compiled
def crc16(payload: NDArray[np.uint8], length: int, data_id: int) -> int:
    """CRC of profile 5 over the first `length` bytes of `payload` (at least 3) and the 16-bit `data_id`."""
    crc = np.uint32(0xFFFF)
    for i in range(_CRC_BYTES, length):
        crc = _add_byte(crc, payload[i])
    crc = _add_byte(crc, data_id & 0xFF)
    crc = _add_byte(crc, (data_id >> 8) & 0xFF)
    return int(crc)


@inner
def crc8(payload: NDArray[np.uint8], length: int, data_id: int) -> int:
    """CRC of profile 1 over the first `length` bytes of `payload` (at least 2) and the 16-bit `data_id`."""
    crc = CRC8_TABLE[data_id & 0xFF]
    crc = CRC8_TABLE[crc ^ ((data_id >> 8) & 0xFF)]
    for i in range(_NIBBLE_BYTE, length):
        crc = CRC8_TABLE[crc ^ payload[i]]
    return int(crc)


@inner
def crc64(payload: NDArray[np.uint8], length: int) -> int:
    """CRC of profile 7 over bytes 8 to `length` of `payload`."""
    crc = np.uint64(0xFFFFFFFFFFFFFFFF)
    for i in range(_LENGTH_7, length):
        low = np.uint64(crc ^ np.uint64(payload[i])) & np.uint64(0xFF)
        crc = np.uint64(crc >> np.uint64(8)) ^ CRC64_TABLE[low]
    return np.uint64(crc ^ np.uint64(0xFFFFFFFFFFFFFFFF))  # type: ignore[return-value]


@compiled
def counter_values(profile: int) -> int:
    """How many values the counter of a profile takes before it begins again at 0."""
    if profile == PROFILE_7:
        return 1 << 32
    return 15 if profile == PROFILE_1 else 256


@compiled
def shortest_frame(profile: int) -> int:
    """Bytes that CRC and counter of a profile take."""
    if profile == PROFILE_7:
        return _HEADER_7
    return 2 if profile == PROFILE_1 else 3


@inner
def _put(payload: NDArray[np.uint8], first: int, length: int, value: int) -> None:
    """A number, high byte first."""
    for i in range(length):
        payload[first + i] = np.uint8((np.uint64(value) >> np.uint64(8 * (length - 1 - i))) & np.uint64(0xFF))


@inner
def _number(payload: NDArray[np.uint8], first: int) -> int:
    """Of four bytes, high byte first."""
    value = 0
    for i in range(first, first + 4):
        value = value << 8 | int(payload[i])
    return value


@separate
def protect(payload: NDArray[np.uint8], length: int, profile: int, data_id: int, counter: int) -> None:
    """Write the counter of the message's `counter`-th frame and then the CRC, in place.

    An unprotected frame stays as it is.
    """
    counter %= counter_values(profile)
    if profile == PROFILE_1:
        payload[_NIBBLE_BYTE] = (payload[_NIBBLE_BYTE] & 0xF0) | counter
        payload[0] = crc8(payload, length, data_id)
    elif profile == PROFILE_5:
        payload[_COUNTER_BYTE] = counter
        crc = crc16(payload, length, data_id)
        payload[0] = crc & 0xFF
        payload[1] = crc >> 8
    elif profile == PROFILE_7:
        _put(payload, _LENGTH_7, 4, length)
        _put(payload, _COUNTER_7, 4, counter)
        _put(payload, _DATA_ID_7, 4, data_id)
        _put(payload, 0, 8, crc64(payload, length))


@compiled
def check(payload: NDArray[np.uint8], length: int, profile: int, data_id: int) -> bool:
    """Whether the CRC in the frame is that of its contents and `data_id`.

    False for a frame too short and for a counter the profile does not have; True for an unprotected message.
    """
    if profile == UNPROTECTED:
        return True
    if not shortest_frame(profile) <= length <= payload.size:
        return False
    if frame_counter(payload, profile) >= counter_values(profile):
        return False
    if profile == PROFILE_1:
        return bool(payload[0] == crc8(payload, length, data_id))
    if profile == PROFILE_7:
        is_ours = _number(payload, _LENGTH_7) == length and _number(payload, _DATA_ID_7) == data_id
        crc64_there = np.uint64(_number(payload, 0)) << np.uint64(32) | np.uint64(_number(payload, 4))
        return bool(is_ours and crc64_there == crc64(payload, length))
    crc = crc16(payload, length, data_id)
    return bool(payload[0] == crc & 0xFF and payload[1] == crc >> 8)


@compiled
def frame_counter(payload: NDArray[np.uint8], profile: int) -> int:
    """Counter of a frame whose length was checked; 0 for an unprotected message."""
    if profile == PROFILE_1:
        return int(payload[_NIBBLE_BYTE] & 0x0F)
    if profile == PROFILE_7:
        return int(_number(payload, _COUNTER_7))
    return int(payload[_COUNTER_BYTE]) if profile == PROFILE_5 else 0


@compiled
def classify(counter: int, last_counter: int, seen: bool, max_delta: int, profile: int) -> E2EStatus:
    """Status of a frame with a good CRC, by its counter.

    `seen`: whether there was a frame before, with `last_counter`. `max_delta`: the largest step of the
    counter that still counts as frames lost and not as a wrong sequence, 1 to two less than its values.
    """
    if not seen:
        return E2EStatus.INITIAL
    delta = (counter - last_counter) % counter_values(profile)
    if delta == 0:
        return E2EStatus.REPEATED
    if delta == 1:
        return E2EStatus.OK
    if delta <= max_delta:
        return E2EStatus.OK_SOME_LOST
    return E2EStatus.WRONG_SEQUENCE


@inner
def _add_byte(crc, byte):  # type: ignore[no-untyped-def]
    return np.uint32((crc << 8) & 0xFF00) ^ np.uint32(CRC16_TABLE[(crc >> 8) ^ byte])
