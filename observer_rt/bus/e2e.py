"""AUTOSAR end-to-end protection, profile 5, as used at the start of every frame.

Bytes 0-1: CRC-16/CCITT-FALSE (polynomial 0x1021, start 0xFFFF), little-endian, over byte 2 to the end of the
frame and then over the data id of the message, low byte first. Byte 2: counter, one more with every frame.
"""

from enum import IntEnum

import numpy as np
from numba import njit
from numpy.typing import NDArray

CRC_BYTES = 2
COUNTER_BYTE = 2
SHORTEST_FRAME = 3  # bytes: CRC and counter


class E2EStatus(IntEnum):
    """What the receiver makes of one frame of a protected message."""

    OK = 0
    OK_SOME_LOST = 1
    REPEATED = 2
    WRONG_SEQUENCE = 3
    CRC_ERROR = 4
    LENGTH_ERROR = 5
    INITIAL = 6


def _crc_table() -> NDArray[np.uint16]:
    remainder = np.arange(256, dtype=np.uint16) << np.uint16(8)
    for _ in range(8):
        remainder = np.where(remainder & 0x8000, (remainder << 1) ^ 0x1021, remainder << 1).astype(np.uint16)
    return remainder


CRC_TABLE = _crc_table()


@njit(cache=True, nogil=True)
def crc16(payload: NDArray[np.uint8], length: int, data_id: int) -> int:
    """CRC of the first `length` bytes of `payload` (at least `SHORTEST_FRAME`) and the 16-bit `data_id`."""
    crc = np.uint32(0xFFFF)
    for i in range(CRC_BYTES, length):
        crc = _add_byte(crc, payload[i])
    crc = _add_byte(crc, data_id & 0xFF)
    crc = _add_byte(crc, (data_id >> 8) & 0xFF)
    return int(crc)


@njit(cache=True, nogil=True)
def protect(payload: NDArray[np.uint8], length: int, data_id: int, counter: int) -> None:
    """Write `counter` (its low 8 bits) and then the CRC into the frame, in place."""
    payload[COUNTER_BYTE] = counter & 0xFF
    crc = crc16(payload, length, data_id)
    payload[0] = crc & 0xFF
    payload[1] = crc >> 8


@njit(cache=True, nogil=True)
def check(payload: NDArray[np.uint8], length: int, data_id: int) -> bool:
    """Whether the CRC in the frame is that of its contents and `data_id`; False for a frame too short."""
    if length < SHORTEST_FRAME or length > payload.size:
        return False
    crc = crc16(payload, length, data_id)
    return bool(payload[0] == crc & 0xFF and payload[1] == crc >> 8)


@njit(cache=True, nogil=True)
def classify(counter: int, last_counter: int, seen: bool, max_delta: int) -> E2EStatus:
    """Status of a frame with a good CRC, by its counter.

    `seen`: whether there was a frame before, with `last_counter`. `max_delta`: the largest step of the
    counter that still counts as frames lost and not as a wrong sequence, 1 to 254.
    """
    if not seen:
        return E2EStatus.INITIAL
    delta = (counter - last_counter) & 0xFF
    if delta == 0:
        return E2EStatus.REPEATED
    if delta == 1:
        return E2EStatus.OK
    if delta <= max_delta:
        return E2EStatus.OK_SOME_LOST
    return E2EStatus.WRONG_SEQUENCE


@njit(cache=True, nogil=True)
def _add_byte(crc, byte):  # type: ignore[no-untyped-def]
    return np.uint32((crc << 8) & 0xFF00) ^ np.uint32(CRC_TABLE[(crc >> 8) ^ byte])
