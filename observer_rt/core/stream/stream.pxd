# Observer over its stream of samples: declarations for other loops of the core.

from libc.stdint cimport int64_t

from observer_rt.core.stream.state cimport Observer, Step


cdef class PairStepper:
    cdef Step step
    cdef void* stepper


cdef class Stream:
    cdef Observer observer
    cdef tuple lent
    cdef PairStepper bound


cdef void take_recorded(Observer* observer, int64_t end, int64_t doubt) noexcept nogil
cdef bint advance_stream(Observer* observer) noexcept nogil
