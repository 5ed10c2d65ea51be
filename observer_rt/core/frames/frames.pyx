"""Frame pipeline: checks, decodes, aligns, observes and publishes each received frame; the loop over sockets.

One unit, for its parts call each other at every frame; a file for each of them.
"""

from libc.math cimport INFINITY, NAN, ceil, copysign, fabs, floor, frexp, isnan, ldexp, rint
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
cdef Signal _signal
cdef Condition _condition
cdef Protection _protection
cdef Supervision _supervision
cdef GridStream _grid_stream
cdef Follower _follower
cdef Slot _slot
cdef AlignmentMemory _alignment_memory
cdef Clock _clock
cdef Counting _counting
cdef Shift _shift
cdef TimekeepingMemory _timekeeping_memory
cdef Timing _timing
cdef InputMessage _input_message
cdef InputStream _input_stream
cdef InputGroup _input_group
cdef OptionalInput _optional_input
cdef InputKind _input_kind
cdef HeardValue _heard_value
cdef Reading _reading
cdef HeardMemory _heard_memory
cdef Receiver _receiver
cdef OutFrame _out_frame
cdef PublisherMemory _publisher_memory
cdef PumpBus _pump_bus
cdef ErrorFrame _error_frame
cdef Arrival _arrival
cdef PumpMemory _pump_memory
RECORDS = {
    "Signal": (memoryview(<Signal[:1:1]> &_signal), _signal),
    "Condition": (memoryview(<Condition[:1:1]> &_condition), _condition),
    "Protection": (memoryview(<Protection[:1:1]> &_protection), _protection),
    "Supervision": (memoryview(<Supervision[:1:1]> &_supervision), _supervision),
    "GridStream": (memoryview(<GridStream[:1:1]> &_grid_stream), _grid_stream),
    "Follower": (memoryview(<Follower[:1:1]> &_follower), _follower),
    "Slot": (memoryview(<Slot[:1:1]> &_slot), _slot),
    "AlignmentMemory": (memoryview(<AlignmentMemory[:1:1]> &_alignment_memory), _alignment_memory),
    "Clock": (memoryview(<Clock[:1:1]> &_clock), _clock),
    "Counting": (memoryview(<Counting[:1:1]> &_counting), _counting),
    "Shift": (memoryview(<Shift[:1:1]> &_shift), _shift),
    "TimekeepingMemory": (memoryview(<TimekeepingMemory[:1:1]> &_timekeeping_memory), _timekeeping_memory),
    "Timing": (memoryview(<Timing[:1:1]> &_timing), _timing),
    "InputMessage": (memoryview(<InputMessage[:1:1]> &_input_message), _input_message),
    "InputStream": (memoryview(<InputStream[:1:1]> &_input_stream), _input_stream),
    "InputGroup": (memoryview(<InputGroup[:1:1]> &_input_group), _input_group),
    "OptionalInput": (memoryview(<OptionalInput[:1:1]> &_optional_input), _optional_input),
    "InputKind": (memoryview(<InputKind[:1:1]> &_input_kind), _input_kind),
    "HeardValue": (memoryview(<HeardValue[:1:1]> &_heard_value), _heard_value),
    "Reading": (memoryview(<Reading[:1:1]> &_reading), _reading),
    "HeardMemory": (memoryview(<HeardMemory[:1:1]> &_heard_memory), _heard_memory),
    "Receiver": (memoryview(<Receiver[:1:1]> &_receiver), _receiver),
    "OutFrame": (memoryview(<OutFrame[:1:1]> &_out_frame), _out_frame),
    "PublisherMemory": (memoryview(<PublisherMemory[:1:1]> &_publisher_memory), _publisher_memory),
    "PumpBus": (memoryview(<PumpBus[:1:1]> &_pump_bus), _pump_bus),
    "ErrorFrame": (memoryview(<ErrorFrame[:1:1]> &_error_frame), _error_frame),
    "Arrival": (memoryview(<Arrival[:1:1]> &_arrival), _arrival),
    "PumpMemory": (memoryview(<PumpMemory[:1:1]> &_pump_memory), _pump_memory),
}
