# Encodes recordings as frames: many of a message at once.

from libc.math cimport NAN
from libc.stdint cimport int64_t, uint8_t

from observer_rt.core.frames.codec cimport put_bits, value_bits
from observer_rt.core.frames.records cimport INDEX_MASK, MAX_INPUTS, InputGroup, InputKind, Inputs, Signal, Timing
from observer_rt.core.frames.timekeeping cimport NUMBERING_COUNTER, NUMBERING_INDEX


cdef inline void encode_column(
    const double* values, int64_t count, const Signal* signal, uint8_t* payloads, int64_t step
) noexcept nogil:
    """As `encode`, one signal of many frames: values (count,), the payloads `step` bytes apart."""
    cdef int64_t row
    for row in range(count):
        put_bits(payloads + row * step, signal, value_bits(values[row], signal))


cdef inline void fill_group(
    const double* values, int64_t rows, int64_t index, int64_t samples, int64_t counter, int64_t counter_step,
    const Inputs* inputs, const InputKind* kinds, const Timing* timing, const InputGroup* group, uint8_t* payloads,
    int64_t frames, int64_t step, double* column
) noexcept nogil:
    """Encode a group in all frames that carry it; index, counter: of the first of them, and steps to the next."""
    cdef int64_t position
    for position in range(group.signal_count):
        _fill_column(column, frames, values, rows, position, index, samples, counter, counter_step, inputs, timing, group)
        encode_column(column, frames, inputs.signals + group.first_signal + position, payloads, step)


cdef inline void _fill_column(
    double* column, int64_t frames, const double* values, int64_t rows, int64_t position, int64_t index, int64_t samples,
    int64_t counter, int64_t counter_step, const Inputs* inputs, const Timing* timings, const InputGroup* group
) noexcept nogil:
    """Write the values of one signal of a group for all frames into a column."""
    cdef int64_t role, inside, frame, row
    timing = &timings[group.stream]
    for role in range(<int64_t> MAX_INPUTS):
        inside = position - group.position[role]
        if (inputs.streams[group.stream].roles >> role) & 1 and 0 <= inside < group.samples:
            for frame in range(frames):
                row = frame * samples + group.offset + inside
                column[frame] = values[row * MAX_INPUTS + role] / group.factor[role] if row < rows else NAN
            return
    for frame in range(frames):
        if position == 0 and timing.numbering == NUMBERING_INDEX:
            column[frame] = <double> ((index + frame * samples) & INDEX_MASK)
        elif position == 0 and timing.numbering == NUMBERING_COUNTER:
            column[frame] = <double> ((counter + frame * counter_step) % timing.modulus)
        else:
            column[frame] = NAN
