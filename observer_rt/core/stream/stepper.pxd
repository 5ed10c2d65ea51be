# Stepper of the pair x~ and x^, and the phi of x^.

from libc.stdint cimport int64_t

from observer_rt.core.model.model cimport Terms
from observer_rt.core.model.records cimport Coefficients, Forced, Forcing, Inputs, Interval, Knot, Network
from observer_rt.core.stream.state cimport Observer
from observer_rt.core.stream.stream cimport PairStepper, Stream

# x^ (n,) a sample interval later, in place.
ctypedef void (*AdvanceXHat)(
    void* phi, double* x, const Interval* interval, Knot knot, const Coefficients* c, const Network* network
) noexcept nogil

# The injection rate [m3/s] at a state not at rest, and the three rows of phi [1/s].
ctypedef double (*ReadPhi)(
    void* phi, const double* x, Inputs u, const Coefficients* c, const Network* network, double* rows
) noexcept nogil

# Replace what x^ carries by a slot of what was posted.
ctypedef void (*PutPhi)(void* phi, int64_t slot) noexcept nogil


cdef class CarriedPhi:
    cdef AdvanceXHat advance
    cdef ReadPhi read
    cdef PutPhi put
    cdef void* phi


cdef struct Stepping:
    Coefficients coefficients  # with the line as the observer's memory has it
    Network network  # whose weights lie there
    Forced forced  # scratch; without terms, its model is the one above
    double fraction  # of a sample, by which the line pressure is recorded late
    double interval  # s
    int64_t substeps
    Observer* observer
    Forcing* of_tilde
    Forcing* of_hat
    AdvanceXHat advance
    ReadPhi read
    PutPhi put
    void* phi


cdef class Stepper(PairStepper):
    cdef Stepping stepping
    cdef Stream stream
    cdef Terms terms_of_tilde
    cdef Terms terms_of_hat
    cdef CarriedPhi carried
