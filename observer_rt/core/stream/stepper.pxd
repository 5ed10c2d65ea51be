# Stepper of the pair x~ and x^.

from libc.stdint cimport int64_t

from observer_rt.core.model.model cimport Terms
from observer_rt.core.model.records cimport MOST_COEFFICIENTS, WIDTH, Coefficients, Forced, Forcing, Gradient, Network
from observer_rt.core.model.sensor cimport SENSOR_NUMBERS
from observer_rt.core.model.valve cimport Stroke, Strokes
from observer_rt.core.stream.state cimport Observer
from observer_rt.core.stream.stream cimport PairStepper, Stream


cdef enum:
    FILTERS = 3
    LIVE_STATES = 7  # p_L, Q_L, p_S, and
    OF_NOZZLE = 3  # .. what the nozzle passes more, as a share,
    OF_SEAT = 4  # .. the seat,
    SHOWN = 5  # .. the indicated pressure,
    OF_DELAY = 6  # .. how much later than learned a needle answers whose lift is not recorded, in NEEDLE_JITTER
    LIVE_PARTS = 2
    LIVE_COLUMNS = LIVE_PARTS * WIDTH  # of all states, and one to spare


cdef struct Filter:
    double[LIVE_STATES] mean
    double[LIVE_STATES][LIVE_STATES] covariance
    double log_weight
    double weight


# live.pxi: the filters, and their scratch.
cdef struct Live:
    bint follows
    bint has_widened  # the first filter, for the flow is not known here
    bint falls  # the needle, whose lift is not recorded
    int64_t states  # that there are
    double variance  # of a sample of the line pressure [p_0^2], as the innovation monitor expects it
    Filter[FILTERS] filters
    double[LIVE_STATES] mean  # of them all
    double[LIVE_STATES] moved_mean  # the same, predicted
    double[LIVE_STATES][LIVE_STATES] change  # of a state by that a sample before
    double[2] bias  # b of the network with what is passed more
    Network network
    Gradient gradient
    unsigned char[LIVE_PARTS] parts
    double[4 * LIVE_COLUMNS] by
    double[4 * LIVE_COLUMNS] moved
    double[4 * 4 * 4] by_state
    double[4 * 4 * LIVE_COLUMNS] by_number
    double[4 * 4 * 2] by_flow
    double[4 * 2 * LIVE_COLUMNS] of_flows
    double[4 * MOST_COEFFICIENTS] by_coefficient
    double[SENSOR_NUMBERS * LIVE_COLUMNS] no_numbers  # zeros
    double[LIVE_COLUMNS] before
    double[LIVE_COLUMNS] indicated
    double[LIVE_COLUMNS] error


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
    Forcing* of_live
    Live live


cdef class Stepper(PairStepper):
    cdef Stepping stepping
    cdef Stream stream
    cdef Terms terms_of_tilde
    cdef Terms terms_of_hat
    cdef Terms terms_of_live
