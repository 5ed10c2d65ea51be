# Pipeline from one received frame to the frames it causes: check, decode, align, observe, publish.

from libc.math cimport INFINITY, fmax, fmin, isnan
from libc.stdint cimport int64_t, uint8_t

from observer_rt.core.frames.alignment cimport decide, store
from observer_rt.core.frames.codec cimport decode, is_selected, value_between
from observer_rt.core.frames.e2e cimport (
    E2E_CRC_ERROR, E2E_INVALID, E2E_LENGTH_ERROR, E2E_OK, E2E_REPEATED, E2E_WRONG_SEQUENCE, UNPROTECTED, classify,
    frame_counter, has_good_crc, supervise
)
from observer_rt.core.frames.frame_numbers cimport COUNT_OLD, COUNT_REPEATED
from observer_rt.core.frames.inputs cimport take_inputs
from observer_rt.core.frames.placing cimport PLACING_ACCEPTED, PLACING_OLD, PLACING_RESTARTED, place_block
from observer_rt.core.frames.publisher cimport publish
from observer_rt.core.frames.records cimport INDEX_MASK, MAX_INPUTS, InputGroup, InputMessage, Pipeline, Supervision
from observer_rt.core.frames.resampling cimport follow
from observer_rt.core.frames.timekeeping cimport (
    JOINING_NEAREST, NUMBERING_E2E_COUNTER, NUMBERING_INDEX, begin_anew, doubt_of, has_place, note_frame,
    number_frame, place_of
)
from observer_rt.core.stream.stream cimport advance_stream, take_recorded


cdef inline bint handle(
    Pipeline* pipeline, int64_t key, const uint8_t* payload, int64_t size, int64_t stamp
) noexcept nogil:
    """Take one frame, received at `stamp` [ns]; `key` as by `can_frame.frame_key`.

    Frames caused are in the publisher's `out`. Returns True when Python must do something first, as of `proceed`.
    """
    return listen(pipeline, key, payload, size, stamp) and proceed(pipeline)


cdef inline bint listen(
    Pipeline* pipeline, int64_t key, const uint8_t* payload, int64_t size, int64_t stamp
) noexcept nogil:
    """Take one frame as `handle` does, but observe nothing; whether it is an input's, whose samples go into the ring."""
    for number in range(pipeline.inputs.message_count):
        if pipeline.inputs.messages[number].key == key:
            _take(pipeline, number, payload, size, stamp)
            return True
    return False


cdef inline bint proceed(Pipeline* pipeline) noexcept nogil:
    """Observe the samples that are aligned, and publish their rates.

    Returns True when to go on it needs a new model or the command of a needle without a lift (`InputMemory`), or the
    judgement of an event (`engine.service.judging`).
    """
    cdef bint waiting
    if pipeline.input_memory.memory.is_due:
        return True
    if pipeline.input_memory.memory.is_news and pipeline.observer.constants.needle.stop > 0.0:
        return True
    waiting = advance_stream(pipeline.observer)
    publish(&pipeline.publisher, pipeline.observer)
    return waiting


cdef inline void _take(
    Pipeline* pipeline, int64_t number, const uint8_t* payload, int64_t size, int64_t stamp
) noexcept nogil:
    """Check, decode and align one frame of an input message; what fails a check is counted and dropped."""
    message = &pipeline.inputs.messages[number]
    pipeline.receiver.frames += message.group_count > 0
    status = check_frame(payload, size, message, &pipeline.supervised[number])
    if _is_refused(pipeline, number, size, status):
        return
    take_inputs(&pipeline.input_memory, &pipeline.inputs, pipeline.observer, number, payload, status, stamp)
    pipeline.publisher.memory.learning = pipeline.input_memory.memory.learning
    if message.group_count > 0 and _take_samples(pipeline, number, payload, stamp):
        decide(&pipeline.alignment)
        decided = pipeline.alignment.memory.decided
        if decided > pipeline.observer.memory.positions.recorded:
            take_recorded(pipeline.observer, decided, doubt_of(&pipeline.keeping))


cdef inline int64_t check_frame(
    const uint8_t* payload, int64_t size, const InputMessage* message, Supervision* supervised
) noexcept nogil:
    """E2EStatus of a frame by its length and its protection, which takes note of it; OK without protection."""
    profile = message.protection.profile
    cdef int64_t status = E2E_OK
    if size != message.length and size != message.padded_length:
        status = E2E_LENGTH_ERROR
    elif not has_good_crc(payload, size, message.length, &message.protection):
        status = E2E_CRC_ERROR
    elif profile != UNPROTECTED:
        counter = frame_counter(payload, profile)
        status = classify(counter, supervised.counter, profile)
        supervised.counter = counter
    if profile != UNPROTECTED:
        supervise(supervised, status)
    return status


cdef inline bint _is_refused(Pipeline* pipeline, int64_t number, int64_t size, int64_t status) noexcept nogil:
    """Whether a frame of this E2EStatus fails a check; each is counted."""
    receiver, supervised = pipeline.receiver, &pipeline.supervised[number]
    if status == E2E_LENGTH_ERROR:
        receiver.length_errors += 1
        receiver.odd_length[number] = size
    elif status == E2E_CRC_ERROR:
        receiver.crc_errors += 1
    elif supervised.state == E2E_INVALID:
        supervised.refused += 1
    else:
        return False
    return True


cdef inline bint _take_samples(
    Pipeline* pipeline, int64_t number, const uint8_t* payload, int64_t stamp
) noexcept nogil:
    """Decode and align the samples of a checked frame; False if none of them has a place."""
    cdef bint follows, restarted = False
    cdef int64_t carried = 0, placed = 0  # bits of streams
    receiver, message = pipeline.receiver, &pipeline.inputs.messages[number]
    profile = message.protection.profile
    counter = frame_counter(payload, profile)
    status = classify(counter, receiver.last_counter[number], profile)
    follows = profile != UNPROTECTED and status == E2E_OK
    for g in range(message.first_group, message.first_group + message.group_count):
        group = &pipeline.inputs.groups[g]
        if not is_selected(payload, &pipeline.inputs.selection, group.first_condition, group.condition_count):
            continue
        carried |= 1 << group.stream
        placing = _take_group(
            pipeline, group, payload, counter, follows and receiver.interrupted[group.stream] == 0, stamp
        )
        if placing == PLACING_ACCEPTED or placing == PLACING_RESTARTED:
            placed |= 1 << group.stream
            restarted |= placing == PLACING_RESTARTED
    if carried != 0 and placed == 0:
        return False
    _note_interruptions(pipeline, message, placed, follows)
    if not restarted and (status == E2E_WRONG_SEQUENCE or status == E2E_REPEATED) and profile != UNPROTECTED:
        receiver.sequence_errors += 1
    receiver.last_counter[number] = counter
    return True


cdef inline void _note_interruptions(
    Pipeline* pipeline, const InputMessage* message, int64_t placed, bint follows
) noexcept nogil:
    """Note which streams a frame interrupts: those without a bit in `placed`, unless it follows the last one."""
    for g in range(message.first_group, message.first_group + message.group_count):
        stream = pipeline.inputs.groups[g].stream
        if (placed >> stream) & 1:
            pipeline.receiver.interrupted[stream] = 0
        elif not follows:
            pipeline.receiver.interrupted[stream] = 1


cdef inline int64_t _take_group(
    Pipeline* pipeline, const InputGroup* group, const uint8_t* payload, int64_t counter, bint contiguous,
    int64_t stamp
) noexcept nogil:
    """Decode and align the samples of one group: its `Placing`.

    counter: of the end-to-end protection; contiguous: it was without gap since the stream's last frame.
    """
    cdef bint is_nearest
    cdef int64_t start, shift, placing
    keeping = &pipeline.keeping
    decode(payload, pipeline.inputs.signals + group.first_signal, group.signal_count, pipeline.receiver.values)
    raw_index = _raw_index(pipeline, group, counter, stamp)
    if raw_index < 0:
        return PLACING_OLD
    is_nearest = keeping.timing[group.stream].joining == JOINING_NEAREST
    shift = 0
    if is_nearest:
        shift = keeping.shifts[group.stream].samples
    placing = place_block(&pipeline.alignment, group.stream, raw_index + shift, group.samples, contiguous, &start)
    if placing == PLACING_ACCEPTED or placing == PLACING_RESTARTED:
        if placing == PLACING_RESTARTED:
            begin_anew(keeping, group.stream)
        if not is_nearest:
            note_frame(keeping, group.stream, start + group.samples - 1, stamp)
        _store(pipeline, group, payload, start)
    return placing


cdef inline int64_t _raw_index(
    Pipeline* pipeline, const InputGroup* group, int64_t counter, int64_t stamp
) noexcept nogil:
    """Index of the group's first sample as sent or, where none is sent, as counted; -1: the frame is dropped."""
    keeping, stream = &pipeline.keeping, group.stream
    timing = &keeping.timing[stream]
    values = pipeline.receiver.values
    if timing.numbering == NUMBERING_INDEX:
        return (<int64_t> values[0] + group.offset) & INDEX_MASK
    cdef int64_t sequence = 0
    if timing.numbering == NUMBERING_E2E_COUNTER:
        sequence = counter
    elif timing.modulus > 1:
        if isnan(values[0]):
            return -1
        sequence = <int64_t> values[0]
    outcome = number_frame(keeping, stream, sequence, stamp)
    if outcome == COUNT_REPEATED:
        pipeline.alignment.memory.repeated += 1
        return -1
    if outcome == COUNT_OLD:
        pipeline.alignment.memory.old += 1
        return -1
    raw_index = keeping.counts[stream].number * group.samples
    if timing.joining == JOINING_NEAREST:
        # its clock goes by its own count, which says where on the grid it belongs
        note_frame(keeping, stream, raw_index + group.samples - 1, stamp)
        if not has_place(keeping, stream):
            return -1
    return raw_index


cdef inline void _store(
    Pipeline* pipeline, const InputGroup* group, const uint8_t* payload, int64_t start
) noexcept nogil:
    """Put the decoded samples of a group, from the index `start` on, onto the grid, and note how far they reach."""
    receiver = pipeline.receiver
    roles = pipeline.inputs.streams[group.stream].roles
    on_grid = pipeline.alignment.streams[group.stream].on_grid
    follower = &pipeline.alignment.followers[group.stream]
    if not on_grid and not has_place(&pipeline.keeping, group.stream):
        return
    for k in range(group.samples):
        for role in range(MAX_INPUTS):
            if (roles >> role) & 1:
                n = group.position[role] + k
                sent = receiver.sample[role] = receiver.values[n] * group.factor[role]
                if isnan(sent):
                    signal = pipeline.inputs.signals + group.first_signal + n
                    sent = value_between(payload, signal, -INFINITY, signal.largest) * group.factor[role]
                    receiver.outside[role] += not isnan(sent)
                receiver.lowest[role] = fmin(receiver.lowest[role], sent)
                receiver.highest[role] = fmax(receiver.highest[role], sent)
                if not (follower.roles >> role) & 1:
                    store(&pipeline.alignment, start + k, role, receiver.sample[role], False, 0.0)
        if follower.roles != 0:
            place = <double> (start + k) if on_grid else place_of(&pipeline.keeping, group.stream, start + k)
            follow(&pipeline.alignment, group.stream, place - follower.early, receiver.sample)
