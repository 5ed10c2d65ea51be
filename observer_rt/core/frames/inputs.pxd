# Optional inputs while frames are taken: values that count until they are too old, readings that wait for Python.

from libc.math cimport NAN, isnan
from libc.stdint cimport int64_t, uint8_t

from observer_rt.core.frames.codec cimport decode, is_selected
from observer_rt.core.frames.e2e cimport E2E_INITIAL, E2E_OK, E2E_REPEATED
from observer_rt.core.frames.records cimport SURROUNDINGS, InputMemory, Inputs
from observer_rt.core.stream.state cimport INJECTIONS, MASK, Observer
from observer_rt.core.stream.validity cimport REASON_INPUT_STALE, REASON_NONE

cdef enum:
    LEARNING_ENABLE = 0  # number of the optional role
    READINGS = 4096  # that wait: 0.8 s of blocks of 20 levels at 100 kHz

cdef extern from *:
    """
    #define GRACE 1.0
    #define PERIOD 0.1
    """
    const double GRACE  # s a value still counts after its sender said that it has none
    const double PERIOD  # s between two changes of the model


cdef inline void take_inputs(
    InputMemory* input_memory, const Inputs* inputs, Observer* observer, int64_t number, const uint8_t* payload, int64_t status, int64_t stamp
) noexcept nogil:
    """Take the optional inputs in a good frame of a message, before its samples; absent values grow older with these.

    status: by its protection, OK without. A frame with the counter of the one before brings nothing new.
    """
    cdef bint follows
    _grow_older(input_memory, observer)
    message = &inputs.messages[number]
    if status != E2E_REPEATED:
        follows = status == E2E_OK or status == E2E_INITIAL
        for n in range(message.first_optional, message.first_optional + message.optional_count):
            row = &inputs.optional[n]
            input_memory.newest[n].follows &= 1 if follows else 0
            if is_selected(payload, &inputs.selection, row.first_condition, row.condition_count):
                _read(input_memory, inputs, observer, n, payload, stamp)
    _take_effect(input_memory, inputs, observer)


cdef inline void _grow_older(InputMemory* input_memory, Observer* observer) noexcept nogil:
    """Let values grow older by the time of the samples, whose index may begin anew."""
    memory = input_memory.memory
    received = observer.memory.positions.received
    if received == 0:
        return
    index = observer.ring[(received - 1) & MASK].index
    if memory.newest >= 0:
        elapsed = max(index - memory.newest, 0)
        memory.since_change += elapsed
        for n in range(input_memory.newest_count):
            input_memory.newest[n].left -= elapsed
    memory.newest = index


cdef inline void _read(
    InputMemory* input_memory, const Inputs* inputs, Observer* observer, int64_t n, const uint8_t* payload, int64_t stamp
) noexcept nogil:
    """Decode the input `n`: keep its value, or have its reading wait for Python."""
    cdef bint is_under_way
    memory, stream = input_memory.memory, observer.memory
    row, newest = &inputs.optional[n], &input_memory.newest[n]
    values = input_memory.values + (memory.came % READINGS) * input_memory.width
    decode(payload, inputs.signals + row.first_signal, row.signal_count, values)
    if row.is_placed and isnan(values[0]):
        return
    for k in range(1 if row.is_placed else 0, row.signal_count):
        values[k] = values[k] * row.factor + row.origin
    samples = 1.0 / observer.constants.interval
    if row.surrounding >= 0 and not row.lowest <= values[0] <= row.highest:
        newest.left = min(newest.left, GRACE * samples)
    elif row.surrounding >= 0 or row.role == LEARNING_ENABLE:
        newest.value = values[0]
        newest.left = row.timeout * samples
        if row.surrounding >= 0:
            memory.is_assumed[row.surrounding] = 0
    else:
        begun = stream.counts.injections_begun
        is_under_way = begun > 0 and observer.injections[(begun - 1) % INJECTIONS].end_position < 0
        reading = &input_memory.readings[memory.came % READINGS]
        reading.row = n
        reading.stamp = stamp
        reading.follows = newest.follows
        reading.processed = stream.positions.processed
        reading.closed = begun - (1 if is_under_way else 0)
        newest.follows = True
        memory.came += 1  # from here on Python may read it
        for k in range(1 if row.is_placed else 0, row.signal_count):
            memory.is_news |= 1 if row.signal_count <= 2 or values[k] != newest.value else 0
            newest.value = values[k]


cdef inline void _take_effect(InputMemory* input_memory, const Inputs* inputs, Observer* observer) noexcept nogil:
    """Apply the values that count now: whether to learn, and the surroundings that the model should have.

    The model changes outside events only; nothing is valid while one of its surroundings is not known.
    """
    cdef bint is_known, is_wanted = False, is_too_soon
    memory, stream = input_memory.memory, observer.memory
    for n in range(input_memory.newest_count):
        value = input_memory.newest[n].value if input_memory.newest[n].left > 0.0 else NAN
        if inputs.optional[n].role == LEARNING_ENABLE:
            memory.learning = memory.may_learn and value != 0.0
        elif inputs.optional[n].surrounding >= 0:
            memory.measured[inputs.optional[n].surrounding] = value
    stream.input_fault = REASON_NONE
    for k in range(<int64_t> SURROUNDINGS):
        if memory.is_input[k]:
            is_known = not isnan(memory.measured[k])
            if is_known and not abs(memory.measured[k] - memory.in_force[k]) < memory.steps[k]:
                is_wanted = True
            if not (memory.is_assumed[k] or (is_known and not isnan(memory.in_force[k]))):
                stream.input_fault = REASON_INPUT_STALE
    is_too_soon = memory.since_change * observer.constants.interval < PERIOD
    memory.is_due = is_wanted and not (is_too_soon or stream.event.in_event)
