"""Frame pipeline: checks, decodes, aligns, observes and publishes each received frame; the loop over sockets.

One unit, for its parts call each other at every frame; a file for each of them.
"""

from libc.math cimport INFINITY, NAN, ceil, floor, fmax, fmin, isnan, rint
from libc.stdint cimport INT64_MAX, int64_t, uint16_t, uint32_t, uint64_t, uint8_t
from libc.stdlib cimport calloc, free
from libc.string cimport memcpy, memset

from numpy import atleast_1d

from observer_rt.core.frames.records cimport *
from observer_rt.core.records import dtype_of, enum_of, tuple_of
from observer_rt.core.stream.state cimport (
    BREAK_JUMP, BREAK_LOSS, BREAK_NONE, BREAK_RESTART, DOUBT_NONE, DOUBT_TIME_BASE, INJECTIONS, LIFT, MASK,
    RECORDED_MASK, RECORDED_RING, STATE_DEGRADED, Observer, Recorded
)
from observer_rt.core.stream.stream cimport Stream, advance_stream, take_recorded
from observer_rt.core.stream.validity cimport REASON_INPUT_STALE, REASON_NONE

cpdef enum:
    SLOTS = 4096  # samples that may wait for another message
    SLOT_MASK = SLOTS - 1
    MAX_INTERPOLATED = 2  # samples that a gap may have without being a loss

cdef int64_t INDEX_MASK = 0xFFFFFFFF  # of a sample index as sent
cdef int64_t NANOSECONDS = 1000000000  # of a second
# Added to the id of a frame for its key, as by bus.can_frame.frame_key.
cdef int64_t EXTENDED_KEY = <int64_t> 1 << 32
cdef int64_t BUS_KEY = <int64_t> 1 << 33  # for each bus before its own

cdef enum:  # Placing
    PLACING_ACCEPTED, PLACING_REPEATED, PLACING_OLD, PLACING_RESTARTED

cdef enum:  # Count
    COUNT_NEXT, COUNT_REPEATED, COUNT_OLD, COUNT_ANEW

cdef enum:  # Joining: how a message's samples are joined to the grid
    JOINING_INDEX = 0  # its index is the grid's
    JOINING_RATIO = 1  # its index counts every n-th sample of the grid
    JOINING_NEAREST = 2  # same time base, but counted: its first sample is the nearest one's, the others follow
    JOINING_CLOCK = 3  # another time base: by both clocks, between samples

cdef enum:  # Numbering: how a message's frames are numbered
    NUMBERING_INDEX = 0  # a signal with the index of the first sample
    NUMBERING_COUNTER = 1  # a signal that counts frames
    NUMBERING_E2E_COUNTER = 2  # the counter of the end-to-end protection
    NUMBERING_STAMPS = 3  # nothing but when they are received


include "codec.pxi"
include "e2e.pxi"
include "clock.pxi"
include "timekeeping.pxi"
include "frame_numbers.pxi"
include "alignment.pxi"
include "placing.pxi"
include "resampling.pxi"
include "inputs.pxi"
include "publisher.pxi"
include "pipeline.pxi"
include "pump.pxi"
include "framing.pxi"
include "python.pxi"


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
