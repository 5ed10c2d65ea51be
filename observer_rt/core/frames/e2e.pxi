# AUTOSAR end-to-end protection at the start of a frame, and the receiver's state machine: see bus.database.e2e.

cdef enum:
    UNPROTECTED = 0
    PROFILE_1 = 1
    PROFILE_2 = 2
    PROFILE_5 = 5
    PROFILE_7 = 7
    CRC_BYTES = 2  # of profile 5
    COUNTER_BYTE = 2
    NIBBLE_BYTE = 1  # with the counter of profiles 1 and 2
    # bytes of profile 7's header, its CRC before them
    LENGTH_7 = 8
    COUNTER_7 = 12
    DATA_ID_7 = 16
    HEADER_7 = 20

cdef enum:  # E2EStatus
    E2E_OK = 0
    E2E_OK_SOME_LOST = 1
    E2E_REPEATED = 2
    E2E_WRONG_SEQUENCE = 3
    E2E_CRC_ERROR = 4
    E2E_LENGTH_ERROR = 5
    E2E_INITIAL = 6

cdef enum:  # E2EState
    E2E_NODATA = 0
    E2E_INIT = 1
    E2E_VALID = 2
    E2E_INVALID = 3

cdef uint8_t CRC8_TABLE[256]
cdef uint8_t CRC8H2F_TABLE[256]
cdef uint16_t CRC16_TABLE[256]
cdef uint64_t CRC64_TABLE[256]


cdef void fill_crc_tables() noexcept nogil:
    """Remainders of every byte: polynomials 0x1D, 0x2F, 0x1021, and 0x42F0E1EBA9EA3693 with its bits in reverse."""
    cdef uint64_t by_8, by_8h2f, by_16, by_64
    cdef int byte
    for byte in range(256):
        by_8, by_8h2f, by_16, by_64 = byte, byte, <uint64_t> byte << 8, byte
        for _ in range(8):
            by_8 = (by_8 << 1 ^ 0x1D if by_8 & 0x80 else by_8 << 1) & 0xFF
            by_8h2f = (by_8h2f << 1 ^ 0x2F if by_8h2f & 0x80 else by_8h2f << 1) & 0xFF
            by_16 = (by_16 << 1 ^ 0x1021 if by_16 & 0x8000 else by_16 << 1) & 0xFFFF
            by_64 = by_64 >> 1 ^ <uint64_t> 0xC96C5795D7870F42 if by_64 & 1 else by_64 >> 1
        CRC8_TABLE[byte], CRC8H2F_TABLE[byte] = <uint8_t> by_8, <uint8_t> by_8h2f
        CRC16_TABLE[byte], CRC64_TABLE[byte] = <uint16_t> by_16, by_64


fill_crc_tables()


cdef uint32_t crc16(const uint8_t* payload, int64_t length, int64_t data_id) noexcept nogil:
    """CRC of profile 5 over the first `length` bytes of `payload` (at least 3) and the 16-bit `data_id`."""
    cdef uint32_t crc = 0xFFFF
    for i in range(<int64_t> CRC_BYTES, length):
        crc = _add_byte(crc, payload[i])
    crc = _add_byte(crc, data_id & 0xFF)
    return _add_byte(crc, (data_id >> 8) & 0xFF)


cdef inline uint32_t _add_byte(uint32_t crc, int64_t byte) noexcept nogil:
    return ((crc << 8) & 0xFF00) ^ CRC16_TABLE[((crc >> 8) ^ byte) & 0xFF]


cdef uint8_t crc8(const uint8_t* payload, int64_t length, int64_t data_id) noexcept nogil:
    """CRC of profile 1 over the first `length` bytes of `payload` (at least 2) and the 16-bit `data_id`."""
    cdef uint8_t start = CRC8_TABLE[CRC8_TABLE[data_id & 0xFF] ^ ((data_id >> 8) & 0xFF)]
    return _crc8_on(start, payload, length, CRC8_TABLE)


cdef uint8_t crc8h2f(const uint8_t* payload, int64_t length, uint8_t data_id) noexcept nogil:
    """CRC of profile 2, as `crc8`; the data id is of 8 bits."""
    return CRC8H2F_TABLE[_crc8_on(0xFF, payload, length, CRC8H2F_TABLE) ^ data_id] ^ 0xFF


cdef uint8_t _crc8_on(uint8_t crc, const uint8_t* payload, int64_t length, const uint8_t* table) noexcept nogil:
    for i in range(<int64_t> NIBBLE_BYTE, length):
        crc = table[crc ^ payload[i]]
    return crc


cdef uint64_t crc64(const uint8_t* payload, int64_t length) noexcept nogil:
    """CRC of profile 7 over bytes 8 to `length` of `payload`."""
    cdef uint64_t crc = ~(<uint64_t> 0)
    for i in range(<int64_t> LENGTH_7, length):
        crc = crc >> 8 ^ CRC64_TABLE[(crc ^ payload[i]) & 0xFF]
    return ~crc


cdef int64_t counter_values(int64_t profile) noexcept nogil:
    """How many values the counter of a profile takes before it begins again at 0."""
    if profile == PROFILE_7:
        return <int64_t> 1 << 32
    if profile == PROFILE_2:
        return DATA_IDS
    return 15 if profile == PROFILE_1 else 256


cdef int64_t shortest_frame(int64_t profile) noexcept nogil:
    """Bytes that CRC and counter of a profile take."""
    if profile == PROFILE_7:
        return HEADER_7
    return 2 if profile == PROFILE_1 or profile == PROFILE_2 else 3


cdef void _put_number(uint8_t* payload, int64_t length, uint64_t value) noexcept nogil:
    """A number, high byte first."""
    for i in range(length):
        payload[i] = <uint8_t> (value >> (8 * (length - 1 - i)))


cdef int64_t _number(const uint8_t* payload) noexcept nogil:
    """Of four bytes, high byte first."""
    cdef int64_t value = 0
    for i in range(4):
        value = value << 8 | payload[i]
    return value


cdef void protect(uint8_t* payload, int64_t length, const Protection* protection, int64_t counter) noexcept nogil:
    """Write the counter of the message's `counter`-th frame and then the CRC, in place; nothing without protection."""
    profile = protection.profile
    counter %= counter_values(profile)
    if profile == PROFILE_1 or profile == PROFILE_2:
        payload[NIBBLE_BYTE] = <uint8_t> ((payload[NIBBLE_BYTE] & 0xF0) | counter)
        payload[0] = _byte_crc(payload, length, protection, counter)
    elif profile == PROFILE_5:
        payload[COUNTER_BYTE] = <uint8_t> counter
        crc = crc16(payload, length, protection.data_id)
        payload[0], payload[1] = <uint8_t> crc, <uint8_t> (crc >> 8)
    elif profile == PROFILE_7:
        _put_number(payload + LENGTH_7, 4, length)
        _put_number(payload + COUNTER_7, 4, counter)
        _put_number(payload + DATA_ID_7, 4, protection.data_id)
        _put_number(payload, 8, crc64(payload, length))


cdef bint check(const uint8_t* payload, int64_t size, int64_t length, const Protection* protection) noexcept nogil:
    """Whether the CRC in a frame of `size` bytes is that of its first `length` and its data id.

    False for a frame too short and for a counter the profile does not have; True for an unprotected message.
    """
    cdef uint64_t there
    cdef bint is_ours
    profile = protection.profile
    if profile == UNPROTECTED:
        return True
    if not shortest_frame(profile) <= length <= size:
        return False
    counter = frame_counter(payload, profile)
    if counter >= counter_values(profile):
        return False
    if profile == PROFILE_1 or profile == PROFILE_2:
        return payload[0] == _byte_crc(payload, length, protection, counter)
    if profile == PROFILE_7:
        is_ours = _number(payload + LENGTH_7) == length and _number(payload + DATA_ID_7) == protection.data_id
        there = <uint64_t> _number(payload) << 32 | <uint64_t> _number(payload + 4)
        return is_ours and there == crc64(payload, length)
    crc = crc16(payload, length, protection.data_id)
    return payload[0] == (crc & 0xFF) and payload[1] == crc >> 8


cdef uint8_t _byte_crc(
    const uint8_t* payload, int64_t length, const Protection* protection, int64_t counter
) noexcept nogil:
    """CRC of profile 1 or 2."""
    if protection.profile == PROFILE_1:
        return crc8(payload, length, protection.data_id)
    return crc8h2f(payload, length, protection.data_ids[counter])


cdef int64_t frame_counter(const uint8_t* payload, int64_t profile) noexcept nogil:
    """Counter of a frame whose length was checked; 0 for an unprotected message."""
    if profile == PROFILE_1 or profile == PROFILE_2:
        return payload[NIBBLE_BYTE] & 0x0F
    if profile == PROFILE_7:
        return _number(payload + COUNTER_7)
    return payload[COUNTER_BYTE] if profile == PROFILE_5 else 0


cdef int64_t classify(
    int64_t counter, int64_t last_counter, bint seen, int64_t max_delta, int64_t profile
) noexcept nogil:
    """E2EStatus of a frame with a good CRC, by its counter: see bus.database.e2e."""
    cdef int64_t values, delta
    if not seen:
        return E2E_INITIAL
    values = counter_values(profile)
    delta = (counter - last_counter) % values
    if delta < 0:
        delta += values
    if delta == 0:
        return E2E_REPEATED
    if delta == 1:
        return E2E_OK
    return E2E_OK_SOME_LOST if delta <= max_delta else E2E_WRONG_SEQUENCE


cdef void supervise(Supervision* memory, int64_t status) noexcept nogil:
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


cdef bint is_selected(
    const uint8_t* payload, const Selection* selection, int64_t first, int64_t count
) noexcept nogil:
    """Whether a frame meets the conditions in rows [first, first + count) of `selection`."""
    cdef int64_t row = first, end = first + count, selector
    cdef uint64_t bits
    cdef bint is_met
    while row < end:
        selector = selection.conditions[row].selector
        bits = field_bits(payload, &selection.selectors[selector])
        is_met = False
        while row < end and selection.conditions[row].selector == selector:
            is_met |= selection.conditions[row].value == bits
            row += 1
        if not is_met:
            return False
    return True
