# AUTOSAR end-to-end protection at the start of a frame, and the receiver's state machine: see bus.database.e2e.

from libc.stdint cimport int64_t, uint16_t, uint32_t, uint64_t, uint8_t

from observer_rt.core.frames.records cimport Protection, Supervision

cdef enum:
    UNPROTECTED = 0
    PROFILE_1 = 1
    PROFILE_5 = 5
    CRC_BYTES = 2  # of profile 5
    COUNTER_BYTE = 2
    NIBBLE_BYTE = 1  # with the counter of profile 1
    MAX_COUNTER_STEP = 15  # larger ones are a wrong sequence, not a few lost frames

cdef enum:  # E2EStatus
    E2E_OK = 0
    E2E_OK_SOME_LOST = 1
    E2E_REPEATED = 2
    E2E_WRONG_SEQUENCE = 3
    E2E_CRC_ERROR = 4
    E2E_LENGTH_ERROR = 5
    E2E_INITIAL = 6

cdef enum:  # E2EState: of the receiver's state machine, over the frames of a protected message
    E2E_NODATA = 0
    E2E_INIT = 1
    E2E_VALID = 2
    E2E_INVALID = 3

cdef extern from *:
    """
    #include <stdint.h>
    static uint8_t CRC8_TABLE[256];
    static uint16_t CRC16_TABLE[256];
    """
    uint8_t[256] CRC8_TABLE  # of every module its own: it calls `fill_crc_tables` before it computes a CRC
    uint16_t[256] CRC16_TABLE


cdef inline void fill_crc_tables() noexcept nogil:
    """Remainders of every byte: polynomials 0x1D and 0x1021."""
    cdef uint64_t by_8, by_16
    cdef int byte
    for byte in range(256):
        by_8, by_16 = byte, <uint64_t> byte << 8
        for _ in range(8):
            by_8 = (by_8 << 1 ^ 0x1D if by_8 & 0x80 else by_8 << 1) & 0xFF
            by_16 = (by_16 << 1 ^ 0x1021 if by_16 & 0x8000 else by_16 << 1) & 0xFFFF
        CRC8_TABLE[byte], CRC16_TABLE[byte] = <uint8_t> by_8, <uint16_t> by_16


cdef inline uint32_t crc16(const uint8_t* payload, int64_t length, int64_t data_id) noexcept nogil:
    """CRC of profile 5 over the first `length` bytes of `payload` (at least 3) and the 16-bit `data_id`."""
    cdef uint32_t crc = 0xFFFF
    for i in range(<int64_t> CRC_BYTES, length):
        crc = _add_byte(crc, payload[i])
    crc = _add_byte(crc, data_id & 0xFF)
    return _add_byte(crc, (data_id >> 8) & 0xFF)


cdef inline uint32_t _add_byte(uint32_t crc, int64_t byte) noexcept nogil:
    return ((crc << 8) & 0xFF00) ^ CRC16_TABLE[((crc >> 8) ^ byte) & 0xFF]


cdef inline uint8_t crc8(const uint8_t* payload, int64_t length, int64_t data_id) noexcept nogil:
    """CRC of profile 1 over the first `length` bytes of `payload` (at least 2) and the 16-bit `data_id`."""
    cdef uint8_t crc = CRC8_TABLE[CRC8_TABLE[data_id & 0xFF] ^ ((data_id >> 8) & 0xFF)]
    for i in range(<int64_t> NIBBLE_BYTE, length):
        crc = CRC8_TABLE[crc ^ payload[i]]
    return crc


cdef inline int64_t counter_values(int64_t profile) noexcept nogil:
    """How many values the counter of a profile takes before it begins again at 0."""
    return 15 if profile == PROFILE_1 else 256


cdef inline int64_t shortest_frame(int64_t profile) noexcept nogil:
    """Bytes that CRC and counter of a profile take."""
    return 2 if profile == PROFILE_1 else 3


cdef inline void protect(
    uint8_t* payload, int64_t length, const Protection* protection, int64_t counter
) noexcept nogil:
    """Write the counter of the message's `counter`-th frame and then the CRC, in place; nothing without protection."""
    profile = protection.profile
    counter %= counter_values(profile)
    if profile == PROFILE_1:
        payload[NIBBLE_BYTE] = <uint8_t> ((payload[NIBBLE_BYTE] & 0xF0) | counter)
        payload[0] = crc8(payload, length, protection.data_id)
    elif profile == PROFILE_5:
        payload[COUNTER_BYTE] = <uint8_t> counter
        crc = crc16(payload, length, protection.data_id)
        payload[0], payload[1] = <uint8_t> crc, <uint8_t> (crc >> 8)


cdef inline bint has_good_crc(
    const uint8_t* payload, int64_t size, int64_t length, const Protection* protection
) noexcept nogil:
    """Whether the CRC in a frame of `size` bytes is that of its first `length` and its data id.

    False for a frame too short and for a counter the profile does not have; True for an unprotected message.
    """
    profile = protection.profile
    if profile == UNPROTECTED:
        return True
    if not shortest_frame(profile) <= length <= size:
        return False
    if frame_counter(payload, profile) >= counter_values(profile):
        return False
    if profile == PROFILE_1:
        return payload[0] == crc8(payload, length, protection.data_id)
    crc = crc16(payload, length, protection.data_id)
    return payload[0] == (crc & 0xFF) and payload[1] == crc >> 8


cdef inline int64_t frame_counter(const uint8_t* payload, int64_t profile) noexcept nogil:
    """Counter of a frame whose length was checked; 0 for an unprotected message."""
    if profile == PROFILE_1:
        return payload[NIBBLE_BYTE] & 0x0F
    return payload[COUNTER_BYTE] if profile == PROFILE_5 else 0


cdef inline int64_t classify(int64_t counter, int64_t last_counter, int64_t profile) noexcept nogil:
    """E2EStatus of a frame with a good CRC, by its counter and the last one, -1: there was none."""
    cdef int64_t values, delta
    if last_counter < 0:
        return E2E_INITIAL
    values = counter_values(profile)
    delta = (counter - last_counter) % values
    if delta < 0:
        delta += values
    if delta == 0:
        return E2E_REPEATED
    if delta == 1:
        return E2E_OK
    return E2E_OK_SOME_LOST if delta <= min(<int64_t> MAX_COUNTER_STEP, values // 2) else E2E_WRONG_SEQUENCE


cdef inline void supervise(Supervision* memory, int64_t status) noexcept nogil:
    """Take one frame of a message into its state machine (AUTOSAR E2E_SMCheck).

    Frames that are no error and do not follow count as neither: they only take the place of those that are OK.
    """
    cdef int64_t is_ok = status == E2E_OK or status == E2E_OK_SOME_LOST or status == E2E_INITIAL
    cdef int64_t is_error = status == E2E_CRC_ERROR or status == E2E_LENGTH_ERROR
    cdef int64_t oldest, last
    cdef bint has_few_errors
    if memory.state == E2E_NODATA:
        memory.state = E2E_NODATA if is_error else E2E_INIT
        return
    oldest, last = memory.window - 1, (<int64_t> 1 << memory.window) - 1
    memory.ok += is_ok - ((memory.ok_frames >> oldest) & 1)
    memory.errors += is_error - ((memory.error_frames >> oldest) & 1)
    memory.ok_frames = ((memory.ok_frames << 1) | is_ok) & last
    memory.error_frames = ((memory.error_frames << 1) | is_error) & last
    has_few_errors = memory.errors <= memory.max_errors[memory.state]
    if has_few_errors and memory.ok >= memory.min_ok[memory.state]:
        memory.state = E2E_VALID
    elif memory.state == E2E_VALID or not has_few_errors:
        memory.state = E2E_INVALID
