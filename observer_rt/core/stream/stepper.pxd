# Stepper of the pair x~ and x^.

from libc.stdint cimport int64_t

from observer_rt.core.model.model cimport Terms
from observer_rt.core.model.needle cimport NEEDLE_NUMBERS
from observer_rt.core.model.network cimport CURVES
from observer_rt.core.model.records cimport MOST_COEFFICIENTS, Coefficients, Forced, Forcing, Gradient, Network, Tangent
from observer_rt.core.model.valve cimport Stroke, Strokes
from observer_rt.core.stream.filter_bank cimport NUMBERS, FilterBank
from observer_rt.core.stream.state cimport Observer
from observer_rt.core.stream.stream cimport PairStepper, Stream


cdef enum:
    LIVE_PARTS = 4  # columns of a tangent together: NUMBERS / WIDTH
    LIVE_ROWS = 10  # of the scratch for each state
    LATER = 256  # samples that are remembered until a pilot valve is known to have moved


# live.pxi: the bank of filters, derivatives of x~ and x^ by its numbers, and their scratch.
cdef struct Live:
    bint follows
    bint has_widened  # the first filter, for the flow is not known here
    bint falls  # the needle, whose lift is not recorded
    int64_t followed  # samples since the opening,
    int64_t samples  # .. and of the present stretch
    double[LATER][NUMBERS] later  # slopes of the last innovations
    int64_t together  # innovations whose mean counts,
    int64_t counted  # of them so far,
    double innovation  # .. their sum [p_0],
    double[NUMBERS] slopes_sum  # .. and its slopes
    FilterBank bank
    Gradient of_tilde
    Tangent of_hat
    unsigned char[LIVE_PARTS] parts
    int64_t[MOST_COEFFICIENTS] columns  # of friction and stiffness, with their coefficients of the line
    int64_t[MOST_COEFFICIENTS] numbers
    double[MOST_COEFFICIENTS] slopes
    int64_t[NEEDLE_NUMBERS] needle
    double[NEEDLE_NUMBERS] needle_sizes
    int64_t[NEEDLE_NUMBERS] unused  # columns that nobody reads
    double[NEEDLE_NUMBERS] no_sizes  # zeros
    int64_t[CURVES] no_neurons  # zeros


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
    Live live


cdef class Stepper(PairStepper):
    cdef Stepping stepping
    cdef Stream stream
    cdef Terms terms_of_tilde
    cdef Terms terms_of_hat
    cdef double[:, ::1] scratch
