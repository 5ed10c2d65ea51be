# Decodes and encodes signals of a bus database, by tables of where their bits are: see bus.database.codec.
# A frame carries those signals whose selectors it meets: see bus.database.multiplexing.

from libc.math cimport NAN, isnan, rint
from libc.stdint cimport int64_t, uint32_t, uint64_t, uint8_t
from libc.string cimport memcpy

from observer_rt.core.frames.records cimport Selection, Signal

cdef enum:  # how the bits of a field are to be read
    UNSIGNED = 0
    SIGNED = 1
    FLOAT32 = 2
    FLOAT64 = 3


cdef inline void decode(const uint8_t* payload, const Signal* table, int64_t count, double* out) noexcept nogil:
    """Physical values, in the units of the bus database, of the signals in `table`; NaN: not available, in error, no value."""
    for i in range(count):
        out[i] = value_between(payload, &table[i], table[i].least, table[i].most)


cdef inline double value_between(
    const uint8_t* payload, const Signal* signal, double least, double most
) noexcept nogil:
    """Physical value of a signal whose number before scale and offset is in [least, most]; else NaN."""
    bits = field_bits(payload, signal)
    if (signal.has_not_available and bits == signal.not_available) or (signal.has_error and bits == signal.error):
        return NAN
    raw = raw_number(bits, signal)
    if raw < least or raw > most:
        return NAN
    # An unscaled float passes as it is: adding zero would lose the sign of -0.0.
    if signal.kind >= FLOAT32 and signal.scale == 1.0 and signal.offset == 0.0:
        return raw
    return raw * signal.scale + signal.offset


cdef inline void encode(const double* values, const Signal* table, int64_t count, uint8_t* payload) noexcept nogil:
    """Write physical values into `payload` in place; NaN means not available. Other signals' bits stay."""
    for i in range(count):
        put_bits(payload, &table[i], value_bits(values[i], &table[i]))


cdef inline uint64_t field_bits(const uint8_t* payload, const Signal* signal) noexcept nogil:
    """The bits of a signal's field as they are."""
    cdef uint64_t bits = <uint64_t> payload[signal.first_byte] >> signal.shift
    cdef uint64_t filled = 8 - signal.shift
    cdef int64_t position = signal.first_byte
    for _ in range(1, signal.byte_count):
        position += signal.step
        bits |= <uint64_t> payload[position] << filled
        filled += 8
    return bits & signal.mask


cdef inline void put_bits(uint8_t* payload, const Signal* signal, uint64_t bits) noexcept nogil:
    """Write the low bits of `bits` into a signal's field, in place."""
    cdef uint64_t low_bits = 8 - signal.shift
    cdef uint64_t kept = ~(signal.mask << signal.shift) & 0xFF
    cdef int64_t position = signal.first_byte
    bits &= signal.mask
    payload[position] = <uint8_t> ((payload[position] & kept) | ((bits << signal.shift) & 0xFF))
    for _ in range(1, signal.byte_count):
        position += signal.step
        kept = ~(signal.mask >> low_bits) & 0xFF
        payload[position] = <uint8_t> ((payload[position] & kept) | ((bits >> low_bits) & 0xFF))
        low_bits += 8


cdef inline double raw_number(uint64_t bits, const Signal* signal) noexcept nogil:
    """The number a field holds, before scale and offset."""
    cdef uint32_t low
    cdef float single
    cdef double number
    if signal.kind == UNSIGNED:
        return <double> bits
    if signal.kind == SIGNED:
        return <double> <int64_t> ((bits ^ signal.sign) - signal.sign)
    if signal.kind == FLOAT32:
        low = <uint32_t> bits
        memcpy(&single, &low, sizeof(single))
        return single
    memcpy(&number, &bits, sizeof(number))
    return number


cdef inline uint64_t value_bits(double value, const Signal* signal) noexcept nogil:
    """Bits of the field, low-aligned, that stand for a physical value [unit of the database]."""
    cdef uint64_t bits
    cdef uint32_t low
    cdef float single
    cdef double raw
    if isnan(value):
        if signal.has_not_available:
            return signal.not_available
        if signal.kind < FLOAT32:
            value = 0.0
    raw = (value - signal.offset) / signal.scale
    if raw < signal.lowest:
        raw = signal.lowest
    elif raw > signal.highest:
        raw = signal.highest
    if signal.kind == UNSIGNED:
        bits = <uint64_t> rint(raw)
    elif signal.kind == SIGNED:
        bits = <uint64_t> <int64_t> rint(raw) & signal.mask
    elif signal.kind == FLOAT32:
        single = <float> raw
        memcpy(&low, &single, sizeof(low))
        bits = low
    else:
        memcpy(&bits, &raw, sizeof(bits))
    if signal.has_not_available and bits == signal.not_available:
        return signal.instead_of_not_available
    if signal.has_error and bits == signal.error:
        return signal.instead_of_error
    return bits


cdef inline bint is_selected(
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
