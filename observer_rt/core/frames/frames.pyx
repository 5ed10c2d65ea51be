"""From one received frame to those it causes: check, decode, align, observe, publish; the loop over sockets.

One unit, for its parts call each other at every frame; a file for each of them.
"""

from libc.math cimport INFINITY, NAN, ceil, copysign, fabs, floor, frexp, isnan, ldexp, rint
from libc.stdint cimport INT64_MAX, int64_t, uint16_t, uint32_t, uint64_t, uint8_t
from libc.stdlib cimport calloc, free
from libc.string cimport memcpy, memset

from numpy import atleast_1d

from observer_rt.core.frames.records cimport *
from observer_rt.core.stream.state cimport (
    BREAK_JUMP, BREAK_LOSS, BREAK_NONE, BREAK_RESTART, DOUBT_NONE, DOUBT_TIME_BASE, INJECTIONS, LIFT, MASK, REASON_INPUT_STALE,
    REASON_NONE, RECORDED_MASK, RECORDED_RING, STATE_DEGRADED, Observer, Recorded
)
from observer_rt.core.stream.stream cimport Stream, advance_stream, take_recorded

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
include "alignment.pxi"
include "placing.pxi"
include "inputs.pxi"
include "publisher.pxi"
include "pipeline.pxi"
include "pump.pxi"
include "framing.pxi"
include "python.pxi"
