"""Frame pipeline for Python: checks, decodes, aligns, observes and publishes each frame; the loop over sockets.

Its parts call each other at every frame, and so are headers (`.pxd`) of inline functions, compiled here only.
"""

from libc.stdint cimport int64_t, uint64_t, uint8_t
from libc.stdlib cimport calloc, free
from libc.string cimport memcpy

from numpy import atleast_1d

from observer_rt.core.frames.alignment cimport IMPOSSIBLE, MAX_INTERPOLATED, PATIENCE, SLOTS, decide, store
from observer_rt.core.frames.clock cimport CLOCK_STEP, WINDOW
from observer_rt.core.frames.codec cimport (
    FLOAT32, FLOAT64, SIGNED, UNSIGNED, decode, encode, is_selected, put_bits, raw_number
)
from observer_rt.core.frames.e2e cimport (
    E2E_INIT, E2E_INVALID, E2E_NODATA, E2E_VALID, PROFILE_1, PROFILE_5, UNPROTECTED, counter_values, fill_crc_tables,
    protect, shortest_frame
)
from observer_rt.core.frames.frame_numbers cimport COUNT_ANEW, COUNT_NEXT
from observer_rt.core.frames.framing cimport fill_group
from observer_rt.core.frames.inputs cimport GRACE, LEARNING_ENABLE, READINGS
from observer_rt.core.frames.pipeline cimport check_frame, handle, listen, proceed
from observer_rt.core.frames.placing cimport place_block
from observer_rt.core.frames.publisher cimport FRAMES, FULL, flush
from observer_rt.core.frames.pump cimport (
    BATCH, CANFD_MTU, CONTROL_BYTES, ERRORS, HEADER_BYTES, LATENCIES, SLOT_BYTES, WAITING, WAIT_MS, Pumped, iovec,
    mmsghdr, pollfd, run_pump
)
from observer_rt.core.frames.records cimport (
    LONGEST_FRAME, MAX_INPUTS, MAX_SIGNALS, Alignment, AlignmentMemory, Arrival, Clock, Condition, Counting,
    ErrorFrame, Follower, GridStream, Header, InputGroup, InputKind, InputMemory, InputMessage, InputStream, Inputs,
    OptionalInput, OptionalMemory, OptionalValue, OutFrame, Pipeline, Protection, Publisher, PublisherMemory, PumpBus,
    PumpMemory, Reading, Receiver, Selection, Shift, Signal, Slot, Supervision, Timekeeping, TimekeepingMemory,
    Timing
)
from observer_rt.core.frames.resampling cimport follow
from observer_rt.core.frames.timekeeping cimport (
    JOINING_CLOCK, JOINING_INDEX, JOINING_NEAREST, JOINING_RATIO, NUMBERING_COUNTER, NUMBERING_E2E_COUNTER,
    NUMBERING_INDEX, NUMBERING_STAMPS, doubt_of, is_prompt, note_frame, number_frame, place_at
)
from observer_rt.core.records import dtype_of, enum_of, tuple_of
from observer_rt.core.stream.state cimport RECORDED_RING, Recorded
from observer_rt.core.stream.stream cimport Stream

fill_crc_tables()


def decode_signals(const uint8_t[::1] payload, const Signal[::1] table, double[::1] out) -> None:
    """Physical values `out` (n,), in the units of the bus database, of the signals in `table` (n,).

    payload: the bytes of one frame, at least as long as the message; NaN: not available, or in error.
    """
    _require(out.shape[0] >= table.shape[0], "values")
    if table.shape[0]:
        decode(&payload[0], &table[0], table.shape[0], &out[0])


def encode_signals(const double[::1] values, const Signal[::1] table, uint8_t[::1] payload) -> None:
    """Write physical values (n,), in the units of the bus database, into `payload` in place; NaN: not available."""
    _require(values.shape[0] >= table.shape[0], "values")
    if table.shape[0]:
        encode(&values[0], &table[0], table.shape[0], &payload[0])


def put_signal_bits(uint8_t[::1] payload, signal, uint64_t bits) -> None:
    """Write the low bits of `bits` into a signal's field, in place; signal: one row of a table."""
    cdef const Signal[::1] row = atleast_1d(signal)
    put_bits(&payload[0], &row[0], bits)


def raw_value(uint64_t bits, signal) -> float:
    """The number a field holds, before scale and offset; signal: one row of a table."""
    cdef const Signal[::1] row = atleast_1d(signal)
    return raw_number(bits, &row[0])


def carries(const uint8_t[::1] payload, selection, int64_t first, int64_t count) -> bool:
    """Whether a frame meets the conditions in rows [first, first + count) of a `multiplexing.Selection`."""
    cdef Selection lent
    if count == 0:
        return True
    _lend_selection(&lent, selection)
    _require(0 <= first and first + count <= len(selection.conditions), "conditions")
    return is_selected(&payload[0], &lent, first, count)


def protect_frame(uint8_t[::1] payload, int64_t length, protection, int64_t counter) -> None:
    """Write the counter of the message's `counter`-th frame and then the CRC, in place; protection: `PROTECTION`."""
    cdef const Protection[::1] row = atleast_1d(protection)
    if row[0].profile != UNPROTECTED:
        _require(shortest_frame(row[0].profile) <= length <= payload.shape[0], "bytes")
        protect(&payload[0], length, &row[0], counter)


def status_of_frame(const uint8_t[::1] payload, message, Supervision[::1] supervised) -> int:
    """E2EStatus of a frame of a message, a row `INPUT_MESSAGE`; its state machine, `supervised` (1,), notes it."""
    cdef const InputMessage[::1] row = atleast_1d(message)
    return check_frame(&payload[0] if payload.shape[0] else NULL, payload.shape[0], &row[0], &supervised[0])


def values_of_counter(int64_t profile) -> int:
    """How many values the counter of a profile takes before it begins again at 0."""
    return counter_values(profile)


def shortest_protected(int64_t profile) -> int:
    """Bytes that CRC and counter of a profile take."""
    return shortest_frame(profile)


def time_frame(keeping, int64_t message, int64_t sequence, int64_t last, int64_t stamp) -> tuple[int, int]:
    """Take the counter `sequence` and the `stamp` [ns] of a frame: (Count, Doubt in the times of samples that come now).

    last: index of its last sample, or -1 without an index: it is that of its number then.
    """
    cdef Timekeeping lent
    cdef int64_t outcome = COUNT_NEXT
    _lend_timekeeping(&lent, keeping)
    if last < 0:
        outcome = number_frame(&lent, message, sequence, stamp)
        last = (lent.counts[message].number + 1) * lent.clocks[message].samples - 1
    if outcome == COUNT_NEXT or outcome == COUNT_ANEW:
        note_frame(&lent, message, last, stamp)
    return outcome, doubt_of(&lent)


def store_value(alignment, int64_t index, int64_t role, double value, bint interpolated=False, double share=0.0) -> None:
    """Put one value [SI] of a role at its index on the grid: see alignment.pxd."""
    cdef Alignment lent
    _lend_alignment(&lent, alignment)
    store(&lent, index, role, value, interpolated, share)


def decide_samples(alignment) -> None:
    """Write to the ring what all messages have passed."""
    cdef Alignment lent
    _lend_alignment(&lent, alignment)
    decide(&lent)


def place_samples(alignment, int64_t message, int64_t raw_index, int64_t count, bint contiguous) -> tuple[int, int]:
    """Where a block of `count` samples belongs: (Placing, unwrapped index of its first sample)."""
    cdef Alignment lent
    cdef int64_t first = 0, placing
    _lend_alignment(&lent, alignment)
    placing = place_block(&lent, message, raw_index, count, contiguous, &first)
    return placing, first


def follow_grid(alignment, int64_t message, double position, const double[::1] values) -> None:
    """Take one sample of a follower: where it lies on the grid, and its values (MAX_INPUTS,) [SI]."""
    cdef Alignment lent
    _require(values.shape[0] == MAX_INPUTS, "values")
    _lend_alignment(&lent, alignment)
    follow(&lent, message, position, &values[0])


def frames_of_message(
    const double[:, ::1] values, int64_t index, inputs, int64_t number, int64_t counter, uint8_t[:, ::1] frames,
    double[::1] column
) -> None:
    """Frames (n, length) of one input message for samples (m, MAX_INPUTS) [SI] from `index` on; column: (n,) room."""
    cdef Inputs lent
    cdef const InputKind[::1] kinds = inputs.kinds
    cdef const Timing[::1] timing = inputs.timing
    cdef const InputMessage* message
    cdef const InputGroup* group
    cdef const double* samples = &values[0, 0] if values.shape[0] else NULL
    cdef int64_t kind, frame, g, blocks
    cdef int64_t length = frames.shape[1]
    _lend_inputs(&lent, inputs)
    message = &lent.messages[number]
    _require(values.shape[1] == MAX_INPUTS and length == message.length <= LONGEST_FRAME, "samples or bytes")
    if frames.shape[0] == 0:
        return
    blocks = frames.shape[0] // message.kind_count
    with nogil:
        for kind in range(message.kind_count):
            blank = kinds[message.first_kind + kind].blank
            for frame in range(blocks):
                memcpy(&frames[frame * message.kind_count + kind, 0], blank, length)
            for g in range(message.first_group, message.first_group + message.group_count):
                group = &lent.groups[g]
                if is_selected(blank, &lent.selection, group.first_condition, group.condition_count):
                    fill_group(
                        samples, values.shape[0], index, message.samples, counter + kind, message.kind_count, &lent,
                        &kinds[0], &timing[0], group, &frames[kind, 0], blocks, message.kind_count * length, &column[0],
                    )
        for frame in range(frames.shape[0]):
            protect(&frames[frame, 0], length, &message.protection, counter + frame)


cdef class FramePath:
    """A `messages.Pipeline`, lent: the way from a received frame to the rates it causes. Each array is checked."""

    cdef Pipeline lent
    cdef object lender

    def __init__(self, pipeline) -> None:
        cdef Receiver[::1] receiver = pipeline.receiver
        cdef Supervision[::1] supervised = pipeline.supervised
        cdef Stream stream = pipeline.observer.stream
        p = &self.lent
        _lend_inputs(&p.inputs, pipeline.inputs)
        _require(supervised.shape[0] == p.inputs.message_count, "supervised messages")
        p.receiver, p.supervised, p.observer = &receiver[0], &supervised[0], &stream.observer
        _lend_input_memory(&p.input_memory, pipeline.input_memory)
        _require(p.input_memory.newest_count == p.inputs.optional_count, "optional inputs")
        _lend_timekeeping(&p.keeping, pipeline.keeping)
        _lend_alignment(&p.alignment, pipeline.alignment)
        _lend_publisher(&p.publisher, pipeline.publisher)
        self.lender = pipeline

    def listen(self, int64_t key, const uint8_t[::1] payload, int64_t stamp) -> None:
        """Take one frame, but observe nothing: its samples only go into the observer's ring."""
        listen(&self.lent, key, &payload[0] if payload.shape[0] else NULL, payload.shape[0], stamp)

    def take_many(self, block, int64_t first) -> tuple[int, bool]:
        """Take frames of a `FrameBlock` from `first` on: number of the next, and whether Python must do something first.

        Stops where taking them one by one would have Python do something: also when an event has closed or an input
        is to be read, when rates are FULL, and after every frame where that is asked for.
        """
        cdef const int64_t[::1] keys = block.keys, stamps = block.stamps, starts = block.starts
        cdef const uint8_t[::1] data = block.data
        cdef int64_t number, closed
        cdef const uint8_t* payload = &data[0] if data.shape[0] else NULL
        cdef bint waits = False, is_over
        p = &self.lent
        closed = p.observer.memory.counts.events_closed
        _require(stamps.shape[0] >= keys.shape[0] and starts.shape[0] > keys.shape[0], "frames")
        with nogil:
            number, is_over = first, False
            while number < keys.shape[0] and not is_over:
                waits = handle(p, keys[number], payload + starts[number], starts[number + 1] - starts[number], stamps[number])
                number += 1
                is_over = (
                    waits
                    or p.observer.memory.counts.events_closed != closed
                    or p.publisher.memory.frames >= FULL
                    or p.input_memory.memory.looks_at_each
                    or p.input_memory.memory.came != p.input_memory.memory.read
                )
        return number, waits

    def proceed(self) -> bool:
        """Observe the samples that are aligned, and publish their rates; whether Python must do something first."""
        cdef bint waits
        with nogil:
            waits = proceed(&self.lent)
        return waits

    def flush(self) -> None:
        """Make a frame of the block of rates under way, not valid if anything is missing of it."""
        flush(&self.lent.publisher)

    def place_at(self, int64_t time) -> float:
        """Where on the grid a sample lies that was taken at `time` [ns], by the clock of the stamps; nan: not known."""
        return place_at(&self.lent.keeping, time)

    def is_grid_prompt(self, double tolerance) -> bool:
        """Whether the frames of the grid came when its clock says, to `tolerance` [s], as far as was seen lately."""
        return is_prompt(&self.lent.keeping, tolerance)


cdef class PumpLoop:
    """The pump's loop over sockets, with the buffers that the kernel fills.

    memory (1,), buses (b,), errors (b ERRORS,), arrivals (a,): records of `daemon.pump.Pump`; waiting (WAITING 72,).
    """

    cdef Pumped pump
    cdef object lent

    def __init__(self, memory, buses, errors, arrivals, waiting) -> None:
        cdef PumpMemory[::1] of_memory = memory
        cdef PumpBus[::1] of_buses = buses
        cdef ErrorFrame[::1] of_errors = errors
        cdef Arrival[::1] of_arrivals = arrivals
        cdef uint8_t[::1] of_waiting = waiting
        cdef int64_t place, places
        _require(len(errors) == len(buses) * ERRORS and len(waiting) == WAITING * CANFD_MTU and len(buses) > 0, "records")
        self.lent = (memory, buses, errors, arrivals, waiting)
        p = &self.pump
        p.memory, p.bus_count, p.buses, p.errors = &of_memory[0], of_buses.shape[0], &of_buses[0], &of_errors[0]
        p.arrival_count = of_arrivals.shape[0]
        if p.arrival_count:
            p.arrivals = &of_arrivals[0]
        p.waiting = &of_waiting[0]
        places = p.bus_count * BATCH
        p.polled = <pollfd*> calloc(p.bus_count, sizeof(pollfd))
        p.frames = <uint8_t*> calloc(places, SLOT_BYTES)
        p.control = <uint8_t*> calloc(places, CONTROL_BYTES)
        p.headers = <mmsghdr*> calloc(places, sizeof(mmsghdr))
        p.vectors = <iovec*> calloc(places, sizeof(iovec))
        if p.polled == NULL or p.frames == NULL or p.control == NULL or p.headers == NULL or p.vectors == NULL:
            raise MemoryError("buffers of the pump")
        for place in range(places):
            p.vectors[place].iov_base, p.vectors[place].iov_len = p.frames + place * SLOT_BYTES, SLOT_BYTES
            header = &p.headers[place].msg_hdr
            header.msg_iov, header.msg_iovlen = &p.vectors[place], 1
            header.msg_control = p.control + place * CONTROL_BYTES

    def __dealloc__(self):
        free(self.pump.polled)
        free(self.pump.frames)
        free(self.pump.control)
        free(self.pump.headers)
        free(self.pump.vectors)

    def run(self, FramePath path, int wake) -> bool:
        """Pump until asked to stop (False), or Python must act first, then call again; wake: descriptor for news."""
        cdef bint waits
        with nogil:
            waits = run_pump(&self.pump, &path.lent, wake)
        return waits


cdef void _require(bint is_met, str what) except *:
    if not is_met:
        raise ValueError(f"{what} do not fit what is given with them")


cdef void _lend_selection(Selection* lent, selection) except *:
    cdef const Signal[::1] selectors = selection.selectors
    cdef const Condition[::1] conditions = selection.conditions
    lent.selectors = &selectors[0] if selectors.shape[0] else NULL
    lent.conditions = &conditions[0] if conditions.shape[0] else NULL


cdef void _lend_inputs(Inputs* lent, inputs) except *:
    cdef const InputMessage[::1] messages = inputs.messages
    cdef const InputStream[::1] streams = inputs.streams
    cdef const InputGroup[::1] groups = inputs.groups
    cdef const OptionalInput[::1] optional = inputs.optional
    cdef const Signal[::1] signals = inputs.signals
    lent.message_count, lent.messages = messages.shape[0], &messages[0]
    lent.streams, lent.groups = &streams[0], &groups[0]
    lent.optional_count = optional.shape[0]
    lent.optional = &optional[0] if optional.shape[0] else NULL
    lent.signals = &signals[0] if signals.shape[0] else NULL
    _lend_selection(&lent.selection, inputs.selection)


cdef void _lend_timekeeping(Timekeeping* lent, keeping) except *:
    cdef const TimekeepingMemory[::1] memory = keeping.memory
    cdef const Timing[::1] timing = keeping.timing
    cdef Clock[::1] clocks = keeping.clocks
    cdef Counting[::1] counts = keeping.counts
    cdef Shift[::1] shifts = keeping.shifts
    _require(timing.shape[0] == clocks.shape[0] == counts.shape[0] == shifts.shape[0], "clocks")
    lent.memory, lent.messages, lent.timing = &memory[0], timing.shape[0], &timing[0]
    lent.clocks, lent.counts, lent.shifts = &clocks[0], &counts[0], &shifts[0]


cdef void _lend_alignment(Alignment* lent, alignment) except *:
    cdef AlignmentMemory[::1] memory = alignment.memory
    cdef GridStream[::1] streams = alignment.streams
    cdef Follower[::1] followers = alignment.followers
    cdef Slot[::1] slots = alignment.slots
    cdef Recorded[::1] recorded = alignment.recorded
    _require(
        streams.shape[0] == followers.shape[0] == MAX_INPUTS
        and slots.shape[0] == SLOTS and recorded.shape[0] == RECORDED_RING, "rings"
    )
    lent.memory, lent.streams, lent.followers = &memory[0], &streams[0], &followers[0]
    lent.slots, lent.recorded = &slots[0], &recorded[0]


cdef void _lend_input_memory(InputMemory* lent, input_memory) except *:
    cdef OptionalMemory[::1] memory = input_memory.memory
    cdef OptionalValue[::1] newest = input_memory.newest
    cdef Reading[::1] readings = input_memory.readings
    cdef double[:, ::1] values = input_memory.values
    _require(readings.shape[0] == values.shape[0] == READINGS, "readings")
    lent.memory, lent.newest_count, lent.readings, lent.width = &memory[0], newest.shape[0], &readings[0], values.shape[1]
    if newest.shape[0]:
        lent.newest = &newest[0]
    if values.shape[1]:
        lent.values = &values[0, 0]


cdef void _lend_publisher(Publisher* lent, publisher) except *:
    cdef PublisherMemory[::1] memory = publisher.memory
    cdef const Signal[::1] table = publisher.table
    cdef double[::1] values = publisher.values
    cdef OutFrame[::1] out = publisher.out
    lent.memory, lent.signals = &memory[0], table.shape[0]
    if table.shape[0]:
        _require(values.shape[0] == table.shape[0] and out.shape[0] == FRAMES, "rates")
        lent.table, lent.values, lent.out = &table[0], &values[0], &out[0]


# Constants that Python works with, too.
globals().update(
    CLOCK_STEP=CLOCK_STEP, ERRORS=ERRORS, FLOAT32=FLOAT32, FLOAT64=FLOAT64, FRAMES=FRAMES, GRACE=GRACE,
    HEADER_BYTES=HEADER_BYTES, LATENCIES=LATENCIES, LEARNING_ENABLE=LEARNING_ENABLE, MAX_INPUTS=MAX_INPUTS,
    MAX_INTERPOLATED=MAX_INTERPOLATED, MAX_SIGNALS=MAX_SIGNALS, PATIENCE=PATIENCE, PROFILE_1=PROFILE_1,
    PROFILE_5=PROFILE_5, READINGS=READINGS, SIGNED=SIGNED, SLOTS=SLOTS, UNPROTECTED=UNPROTECTED, UNSIGNED=UNSIGNED,
    WAITING=WAITING, WAIT_MS=WAIT_MS, WINDOW=WINDOW,
    IMPOSSIBLE=(IMPOSSIBLE[0], IMPOSSIBLE[1], IMPOSSIBLE[2]),
)

# Dtypes of the records, of which Python makes arrays, and the order of a header's signals.
cdef double[1024] _blank  # room for each of them
globals().update(
    SIGNAL=dtype_of(<Signal[:1:1]> <Signal*> _blank, (<Signal*> _blank)[0]),
    CONDITION=dtype_of(<Condition[:1:1]> <Condition*> _blank, (<Condition*> _blank)[0]),
    PROTECTION=dtype_of(<Protection[:1:1]> <Protection*> _blank, (<Protection*> _blank)[0]),
    SUPERVISION=dtype_of(<Supervision[:1:1]> <Supervision*> _blank, (<Supervision*> _blank)[0]),
    STREAM=dtype_of(<GridStream[:1:1]> <GridStream*> _blank, (<GridStream*> _blank)[0]),
    FOLLOWER=dtype_of(<Follower[:1:1]> <Follower*> _blank, (<Follower*> _blank)[0]),
    SLOT=dtype_of(<Slot[:1:1]> <Slot*> _blank, (<Slot*> _blank)[0]),
    ALIGNMENT=dtype_of(<AlignmentMemory[:1:1]> <AlignmentMemory*> _blank, (<AlignmentMemory*> _blank)[0]),
    CLOCK=dtype_of(<Clock[:1:1]> <Clock*> _blank, (<Clock*> _blank)[0]),
    COUNTING=dtype_of(<Counting[:1:1]> <Counting*> _blank, (<Counting*> _blank)[0]),
    SHIFT=dtype_of(<Shift[:1:1]> <Shift*> _blank, (<Shift*> _blank)[0]),
    TIMEKEEPING=dtype_of(<TimekeepingMemory[:1:1]> <TimekeepingMemory*> _blank, (<TimekeepingMemory*> _blank)[0]),
    TIMING=dtype_of(<Timing[:1:1]> <Timing*> _blank, (<Timing*> _blank)[0]),
    INPUT_MESSAGE=dtype_of(<InputMessage[:1:1]> <InputMessage*> _blank, (<InputMessage*> _blank)[0]),
    INPUT_STREAM=dtype_of(<InputStream[:1:1]> <InputStream*> _blank, (<InputStream*> _blank)[0]),
    INPUT_GROUP=dtype_of(<InputGroup[:1:1]> <InputGroup*> _blank, (<InputGroup*> _blank)[0]),
    OPTIONAL_INPUT=dtype_of(<OptionalInput[:1:1]> <OptionalInput*> _blank, (<OptionalInput*> _blank)[0]),
    INPUT_KIND=dtype_of(<InputKind[:1:1]> <InputKind*> _blank, (<InputKind*> _blank)[0]),
    OPTIONAL_VALUE=dtype_of(<OptionalValue[:1:1]> <OptionalValue*> _blank, (<OptionalValue*> _blank)[0]),
    READING=dtype_of(<Reading[:1:1]> <Reading*> _blank, (<Reading*> _blank)[0]),
    OPTIONAL=dtype_of(<OptionalMemory[:1:1]> <OptionalMemory*> _blank, (<OptionalMemory*> _blank)[0]),
    RECEIVER=dtype_of(<Receiver[:1:1]> <Receiver*> _blank, (<Receiver*> _blank)[0]),
    OUT_FRAME=dtype_of(<OutFrame[:1:1]> <OutFrame*> _blank, (<OutFrame*> _blank)[0]),
    PUBLISHER=dtype_of(<PublisherMemory[:1:1]> <PublisherMemory*> _blank, (<PublisherMemory*> _blank)[0]),
    PUMP_BUS=dtype_of(<PumpBus[:1:1]> <PumpBus*> _blank, (<PumpBus*> _blank)[0]),
    ERROR_FRAME=dtype_of(<ErrorFrame[:1:1]> <ErrorFrame*> _blank, (<ErrorFrame*> _blank)[0]),
    ARRIVAL=dtype_of(<Arrival[:1:1]> <Arrival*> _blank, (<Arrival*> _blank)[0]),
    PUMP=dtype_of(<PumpMemory[:1:1]> <PumpMemory*> _blank, (<PumpMemory*> _blank)[0]),
    Header=tuple_of(__name__, "Header", (<Header*> _blank)[0]),
    E2EState=enum_of(
        __name__, "E2EState", NODATA=E2E_NODATA, INIT=E2E_INIT, VALID=E2E_VALID, INVALID=E2E_INVALID
    ),
    Joining=enum_of(
        __name__, "Joining", INDEX=JOINING_INDEX, RATIO=JOINING_RATIO, NEAREST=JOINING_NEAREST, CLOCK=JOINING_CLOCK
    ),
    Numbering=enum_of(
        __name__, "Numbering", INDEX=NUMBERING_INDEX, COUNTER=NUMBERING_COUNTER, E2E_COUNTER=NUMBERING_E2E_COUNTER,
        STAMPS=NUMBERING_STAMPS
    ),
)
assert all(getattr(each, "itemsize", 0) <= sizeof(_blank) for each in list(globals().values()))
