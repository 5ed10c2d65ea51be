"""Frame pipeline: checks, decodes, aligns, observes and publishes each received frame; the loop over sockets.

One unit, for its parts call each other at every frame; a file for each of them.
"""

from libc.math cimport INFINITY, NAN, ceil, floor, fmax, fmin, isnan, rint
from libc.stdint cimport INT64_MAX, int64_t, uint16_t, uint32_t, uint64_t, uint8_t
from libc.stdlib cimport calloc, free
from libc.string cimport memcpy, memset

from numpy import atleast_1d

from observer_rt.core.frames.records cimport *
from observer_rt.core.stream.state cimport (
    BREAK_JUMP, BREAK_LOSS, BREAK_NONE, BREAK_RESTART, DOUBT_NONE, DOUBT_TIME_BASE, INJECTIONS, LIFT, MASK,
    RECORDED_MASK, RECORDED_RING, STATE_DEGRADED, Observer, Recorded
)
from observer_rt.core.stream.stream cimport Stream, advance_stream, take_recorded
from observer_rt.core.stream.validity cimport REASON_INPUT_STALE, REASON_NONE

cdef enum:
    SLOTS = 4096  # samples that may wait for another message
    SLOT_MASK = 4095
    MAX_INTERPOLATED = 2  # samples that a gap may have without being a loss

cdef int64_t INDEX_MASK = 0xFFFFFFFF  # of a sample index as sent

cdef enum:  # Placing
    PLACING_ACCEPTED = 0
    PLACING_REPEATED = 1
    PLACING_OLD = 2
    PLACING_RESTARTED = 3

cdef enum:  # Count
    COUNT_NEXT = 0
    COUNT_REPEATED = 1
    COUNT_OLD = 2
    COUNT_ANEW = 3

cdef enum:  # Joining
    JOINING_INDEX = 0
    JOINING_RATIO = 1
    JOINING_NEAREST = 2
    JOINING_CLOCK = 3

cdef enum:  # Numbering
    NUMBERING_INDEX = 0
    NUMBERING_COUNTER = 1
    NUMBERING_E2E_COUNTER = 2
    NUMBERING_STAMPS = 3


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


# Records as Python makes arrays of them: foundation.records.
cdef double[1024] _blank  # room for each of them
RECORDS = {
    "Signal": (memoryview(<Signal[:1:1]> <Signal*> _blank), (<Signal*> _blank)[0]),
    "Condition": (memoryview(<Condition[:1:1]> <Condition*> _blank), (<Condition*> _blank)[0]),
    "Protection": (memoryview(<Protection[:1:1]> <Protection*> _blank), (<Protection*> _blank)[0]),
    "Supervision": (memoryview(<Supervision[:1:1]> <Supervision*> _blank), (<Supervision*> _blank)[0]),
    "GridStream": (memoryview(<GridStream[:1:1]> <GridStream*> _blank), (<GridStream*> _blank)[0]),
    "Follower": (memoryview(<Follower[:1:1]> <Follower*> _blank), (<Follower*> _blank)[0]),
    "Slot": (memoryview(<Slot[:1:1]> <Slot*> _blank), (<Slot*> _blank)[0]),
    "AlignmentMemory": (memoryview(<AlignmentMemory[:1:1]> <AlignmentMemory*> _blank), (<AlignmentMemory*> _blank)[0]),
    "Clock": (memoryview(<Clock[:1:1]> <Clock*> _blank), (<Clock*> _blank)[0]),
    "Counting": (memoryview(<Counting[:1:1]> <Counting*> _blank), (<Counting*> _blank)[0]),
    "Shift": (memoryview(<Shift[:1:1]> <Shift*> _blank), (<Shift*> _blank)[0]),
    "TimekeepingMemory": (memoryview(<TimekeepingMemory[:1:1]> <TimekeepingMemory*> _blank), (<TimekeepingMemory*> _blank)[0]),
    "Timing": (memoryview(<Timing[:1:1]> <Timing*> _blank), (<Timing*> _blank)[0]),
    "InputMessage": (memoryview(<InputMessage[:1:1]> <InputMessage*> _blank), (<InputMessage*> _blank)[0]),
    "InputStream": (memoryview(<InputStream[:1:1]> <InputStream*> _blank), (<InputStream*> _blank)[0]),
    "InputGroup": (memoryview(<InputGroup[:1:1]> <InputGroup*> _blank), (<InputGroup*> _blank)[0]),
    "OptionalInput": (memoryview(<OptionalInput[:1:1]> <OptionalInput*> _blank), (<OptionalInput*> _blank)[0]),
    "InputKind": (memoryview(<InputKind[:1:1]> <InputKind*> _blank), (<InputKind*> _blank)[0]),
    "OptionalValue": (memoryview(<OptionalValue[:1:1]> <OptionalValue*> _blank), (<OptionalValue*> _blank)[0]),
    "Reading": (memoryview(<Reading[:1:1]> <Reading*> _blank), (<Reading*> _blank)[0]),
    "OptionalMemory": (memoryview(<OptionalMemory[:1:1]> <OptionalMemory*> _blank), (<OptionalMemory*> _blank)[0]),
    "Receiver": (memoryview(<Receiver[:1:1]> <Receiver*> _blank), (<Receiver*> _blank)[0]),
    "OutFrame": (memoryview(<OutFrame[:1:1]> <OutFrame*> _blank), (<OutFrame*> _blank)[0]),
    "PublisherMemory": (memoryview(<PublisherMemory[:1:1]> <PublisherMemory*> _blank), (<PublisherMemory*> _blank)[0]),
    "PumpBus": (memoryview(<PumpBus[:1:1]> <PumpBus*> _blank), (<PumpBus*> _blank)[0]),
    "ErrorFrame": (memoryview(<ErrorFrame[:1:1]> <ErrorFrame*> _blank), (<ErrorFrame*> _blank)[0]),
    "Arrival": (memoryview(<Arrival[:1:1]> <Arrival*> _blank), (<Arrival*> _blank)[0]),
    "PumpMemory": (memoryview(<PumpMemory[:1:1]> <PumpMemory*> _blank), (<PumpMemory*> _blank)[0]),
}
assert all(view.itemsize <= sizeof(_blank) for view, _ in RECORDS.values())
