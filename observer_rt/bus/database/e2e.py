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

What the frames of a message are worth together says the receiver's state machine (AUTOSAR E2E_SM).
"""

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from observer_rt.foundation.compiled import compiled, inner, inner_separate, separate

UNPROTECTED = 0
PROFILE_1 = 1
PROFILE_2 = 2
PROFILE_5 = 5
PROFILE_7 = 7
PROFILES = (PROFILE_1, PROFILE_2, PROFILE_5, PROFILE_7)
_CRC_BYTES = 2  # of profile 5
_COUNTER_BYTE = 2
_NIBBLE_BYTE = 1  # with the counter of profiles 1 and 2
DATA_IDS = 16  # of profile 2, one for every value of its counter
_LENGTH_7, _COUNTER_7, _DATA_ID_7, _HEADER_7 = (
    8,
    12,
    16,
    20,
)  # bytes of profile 7's header, its CRC before them


PROTECTION = np.dtype(
    [
        ("profile", np.int64),
        ("data_id", np.int64),  # of any but profile 2
        ("data_ids", np.uint8, (DATA_IDS,)),
    ],
    align=True,
)


def protection_of(profile: int | None, data_id: int | bytes | None) -> np.void:
    """How a message is protected, `PROTECTION`; data_id: of profile 2 all of them."""
    row = np.zeros(1, PROTECTION)
    row["profile"] = profile or UNPROTECTED
    if isinstance(data_id, bytes):
        row["data_ids"] = np.frombuffer(data_id, np.uint8)
    else:
        row["data_id"] = data_id or 0
    found: np.void = row[0]
    return found


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
CRC8H2F_TABLE = _crc_table(8, 0x2F).astype(np.uint8)


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
    start = CRC8_TABLE[CRC8_TABLE[data_id & 0xFF] ^ ((data_id >> 8) & 0xFF)]
    return int(_crc8_on(start, payload, length, CRC8_TABLE))


@inner
def crc8h2f(payload: NDArray[np.uint8], length: int, data_id: int) -> int:
    """CRC of profile 2, as `crc8`; the data id is of 8 bits."""
    crc = _crc8_on(np.uint8(0xFF), payload, length, CRC8H2F_TABLE)
    return int(CRC8H2F_TABLE[crc ^ data_id] ^ 0xFF)


@inner
def _crc8_on(crc, payload, length, table):  # type: ignore[no-untyped-def]
    for i in range(_NIBBLE_BYTE, length):
        crc = table[crc ^ payload[i]]
    return crc


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
    if profile == PROFILE_2:
        return DATA_IDS
    return 15 if profile == PROFILE_1 else 256


@compiled
def shortest_frame(profile: int) -> int:
    """Bytes that CRC and counter of a profile take."""
    if profile == PROFILE_7:
        return _HEADER_7
    return 2 if profile in (PROFILE_1, PROFILE_2) else 3


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
def protect(payload: NDArray[np.uint8], length: int, protection: Any, counter: int) -> None:
    """Write the counter of the message's `counter`-th frame and then the CRC, in place.

    protection: of the message, `PROTECTION`. An unprotected frame stays as it is.
    """
    profile = protection.profile
    counter %= counter_values(profile)
    if profile in (PROFILE_1, PROFILE_2):
        payload[_NIBBLE_BYTE] = (payload[_NIBBLE_BYTE] & 0xF0) | counter
        payload[0] = _byte_crc(payload, length, protection, counter)
    elif profile == PROFILE_5:
        payload[_COUNTER_BYTE] = counter
        crc = crc16(payload, length, protection.data_id)
        payload[0] = crc & 0xFF
        payload[1] = crc >> 8
    elif profile == PROFILE_7:
        _put(payload, _LENGTH_7, 4, length)
        _put(payload, _COUNTER_7, 4, counter)
        _put(payload, _DATA_ID_7, 4, protection.data_id)
        _put(payload, 0, 8, crc64(payload, length))


@compiled
def check(payload: NDArray[np.uint8], length: int, protection: Any) -> bool:
    """Whether the CRC in the frame is that of its contents and its data id.

    False for a frame too short and for a counter the profile does not have; True for an unprotected message.
    """
    profile, data_id = protection.profile, protection.data_id
    if profile == UNPROTECTED:
        return True
    if not shortest_frame(profile) <= length <= payload.size:
        return False
    counter = frame_counter(payload, profile)
    if counter >= counter_values(profile):
        return False
    if profile in (PROFILE_1, PROFILE_2):
        return bool(payload[0] == _byte_crc(payload, length, protection, counter))
    if profile == PROFILE_7:
        is_ours = _number(payload, _LENGTH_7) == length and _number(payload, _DATA_ID_7) == data_id
        crc64_there = np.uint64(_number(payload, 0)) << np.uint64(32) | np.uint64(_number(payload, 4))
        return bool(is_ours and crc64_there == crc64(payload, length))
    crc = crc16(payload, length, data_id)
    return bool(payload[0] == crc & 0xFF and payload[1] == crc >> 8)


@inner
def _byte_crc(payload, length, protection, counter):  # type: ignore[no-untyped-def]
    """CRC of profile 1 or 2."""
    if protection.profile == PROFILE_1:
        return crc8(payload, length, protection.data_id)
    return crc8h2f(payload, length, protection.data_ids[counter])


@compiled
def frame_counter(payload: NDArray[np.uint8], profile: int) -> int:
    """Counter of a frame whose length was checked; 0 for an unprotected message."""
    if profile in (PROFILE_1, PROFILE_2):
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


class E2EState(IntEnum):
    """What the frames of a protected message are worth together."""

    NODATA = 0
    INIT = 1
    VALID = 2
    INVALID = 3


_NODATA, _INIT, _VALID, _INVALID = (int(state) for state in E2EState)

SUPERVISION = np.dtype(
    [
        ("state", np.int64),  # E2EState
        ("counter", np.int64),  # of the last frame with a good CRC, -1: none yet
        # of the last frames, the newest in the lowest bit
        ("ok_frames", np.int64),
        ("error_frames", np.int64),
        ("ok", np.int64),  # how many of them
        ("errors", np.int64),
        ("refused", np.int64),  # good frames that came while the state was INVALID
        # as the bench says
        ("window", np.int64),  # frames
        ("min_ok", np.int64, (len(E2EState),)),  # by state
        ("max_errors", np.int64, (len(E2EState),)),
    ],
    align=True,
)


@inner_separate
def supervise(memory: Any, status: E2EStatus) -> None:
    """Take one frame of a message into its state machine (AUTOSAR E2E_SMCheck); memory: `SUPERVISION`.

    Frames that are no error and do not follow count as neither: they only take the place of those that are OK.
    """
    is_ok = int(status == E2EStatus.OK or status == E2EStatus.OK_SOME_LOST or status == E2EStatus.INITIAL)
    is_error = int(status == E2EStatus.CRC_ERROR or status == E2EStatus.LENGTH_ERROR)
    if memory.state == _NODATA:
        memory.state = _NODATA if is_error else _INIT
        return
    oldest = memory.window - 1
    memory.ok += is_ok - ((memory.ok_frames >> oldest) & 1)
    memory.errors += is_error - ((memory.error_frames >> oldest) & 1)
    memory.ok_frames = ((memory.ok_frames << 1) | is_ok) & ((1 << memory.window) - 1)
    memory.error_frames = ((memory.error_frames << 1) | is_error) & ((1 << memory.window) - 1)
    has_few_errors = memory.errors <= memory.max_errors[memory.state]
    if has_few_errors and memory.ok >= memory.min_ok[memory.state]:
        memory.state = _VALID
    elif memory.state == _VALID or not has_few_errors:
        memory.state = _INVALID
