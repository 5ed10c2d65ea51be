# Stepper of the pair x~ and x^.

from libc.stdint cimport int64_t

from observer_rt.core.model.model cimport Terms
from observer_rt.core.model.records cimport Coefficients, Forced, Forcing, Network
from observer_rt.core.model.valve cimport Stroke, Strokes
from observer_rt.core.stream.state cimport Observer
from observer_rt.core.stream.stream cimport PairStepper, Stream


cdef struct Stepping:
    Coefficients coefficients  # with the line as the observer's memory has it
    Network network  # whose weights lie there
    Forced forced  # scratch; without terms, its model is the one above
    double fraction  # of a sample, by which the line pressure is recorded late
    double interval  # s
    int64_t substeps
    int64_t started  # position
    Strokes strokes
    int64_t commands  # taken in so far
    Stroke command_before
    Stroke command
    Observer* observer
    Forcing* of_tilde
    Forcing* of_hat


cdef class Stepper(PairStepper):
    cdef Stepping stepping
    cdef Stream stream
    cdef Terms terms_of_tilde
    cdef Terms terms_of_hat
