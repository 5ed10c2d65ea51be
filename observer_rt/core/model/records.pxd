# Records of the model for its functions: coefficients, network, inputs, tangents of derivatives.

from libc.stdint cimport int64_t
from libc.string cimport memset

from observer_rt.core.model.hydraulics cimport NOZZLE_NUMBERS, Nozzle, Sac, Seat
from observer_rt.core.model.needle cimport NEEDLE_NUMBERS
from observer_rt.core.model.network cimport INPUTS
from observer_rt.core.model.valve cimport VALVE_NUMBERS, Servo, Valve

cdef enum:
    MOST_COEFFICIENTS = 24  # of a line
    SAC = 2  # place of p_S in x
    LUMP_STATES = 3  # p_L, Q_L, p_S, and ..
    MEAN_STATES = 4  # .. the integral of p_L, whose means are recorded
    MEMORIES = 3  # states of a wave's line that remember its flow
    TOTALS = 10  # equations that terms may correct
    PAST_NUMBERS = 8  # remembered from sample to sample, whatever the terms
    WIDTH = 4  # columns of a tangent reckoned together, as a register holds; tangents are a multiple of it wide

cdef extern from *:
    """
    typedef double columns_of_a_tangent __attribute__((vector_size(32), aligned(8), may_alias));
    """
    ctypedef double Columns "columns_of_a_tangent"  # WIDTH numbers as one: the compiler makes no vectors of a loop over them


# How a line softens, the same fields of every line.
cdef struct Softness:
    double air  # K g / p_0: how much entrained air softens the line, 0 without any
    double stiffness_slope  # how stiffness grows with the line pressure, 0 when it does not
    double stiffness_bend  # likewise with the square of it
    double stiffness_pressure  # where it is that of a1, normalised as x_1
    double chamber_pressure  # p_C/p_0


cdef struct Drain:
    double control_flow  # of the pilot valve at p_0: a1 c / Q_0
    double displaced  # by 1 m/s of the needle: a1 A_d / Q_0
    double expelled  # through the open pilot valve, by 1 m/s of a needle that rises: a1 A_c / Q_0


cdef struct LumpLine:
    double a1  # line inflow, 1/s
    double a2_nozzle  # line drained by the nozzle flow; 0 in the form that the seat flow drains
    double a2_seat  # line drained by the seat flow, the mass-conserving form
    double a3  # line inertia
    double a4  # line friction
    double leak  # line drained by p_L - p_C, 0 for a tight injector
    Softness softness
    Drain drain
    double outflow  # of the end, by terms, in units of Q_0
    double loss  # of pressure along the line, by terms, in units of p_0


cdef struct WaveLine:
    # Rates [1/s] normalised by (24), of one cell or face; "near" is the part at the injector.
    double a1  # end cell, inflow
    double a2_nozzle  # end cell, drained by the nozzle flow
    double a2_seat  # end cell, drained by the seat flow
    double a3  # inertia of a face
    double a3_near
    double a4  # friction, over the whole line that of the lump
    double a4_inlet  # of a throttle at the rail, added to that of the first face
    double memory  # sqrt(nu_w)/R [s^-1/2] of the friction that remembers
    double b  # compliance of a cell
    double b_near
    double damping  # nu/h2: what evens out the flows of neighbouring faces
    double leak  # end cell, drained by p_L - p_C
    Softness softness
    double cells  # n
    double joint  # where the parts meet, in cells from the rail
    Drain drain
    double outflow  # as of the lump
    double loss  # likewise, spread evenly over the faces


cdef union Line:
    LumpLine lump
    WaveLine wave
    double[MOST_COEFFICIENTS] values


cdef struct Coefficients:
    int64_t kind  # of line: interval.pxi
    bint is_mean  # its last state is the integral of p_L
    int64_t states  # n of x
    int64_t cells  # of a wave's line
    int64_t size  # coefficients of the line
    Line line
    double[MOST_COEFFICIENTS] of_stiffness  # 1 where a coefficient of the line goes with the bulk modulus, else 0
    double[MOST_COEFFICIENTS] of_inertance  # likewise with the inverse of the inertance
    Seat seat
    Nozzle nozzle
    Sac sac
    double pressure_scale  # p_0, Pa
    double flow_scale  # Q_0, m3/s
    double area_scale  # A_0, m2
    Valve valve
    double chamber_pressure  # p_C, Pa
    double density  # rho_C, kg/m3
    double compression  # p_0/K_L, of the nominal line


cdef struct Network:
    const double* curves  # (CURVES, PIECES, 4): what the hidden layer adds up to, W sigma(V z); NULL: nothing
    const double* bias  # b (2,)
    const double* nozzle  # (NOZZLE_NUMBERS,)


cdef struct Inputs:
    double rail  # p_R
    double area  # A_S
    double since  # s, that the needle opened
    Servo servo
    double[NEEDLE_NUMBERS] by_needle  # slopes of A_S by what is learned of a needle that answers commands
    int64_t shot  # number of the command


cdef inline Inputs inputs_of(double rail, double area) noexcept nogil:
    """Inputs while the pilot valve is shut and the needle does not move."""
    cdef Inputs u
    memset(&u, 0, sizeof(Inputs))
    u.rail, u.area = rail, area
    return u


cdef inline double opened_since(double before, double area_before, double area) noexcept nogil:
    """Time since the needle opened [s] at the start of an interval, by that at the end of the one before."""
    return 0.0 if area_before <= 0.0 and area > 0.0 else before


cdef struct Interval:
    Inputs start
    Inputs end
    double length  # s
    int64_t substeps  # RK4 steps at most


cdef struct Knot:
    double share  # of the interval, after which the area bends; 0: it does not
    double area


# How a parameter vector theta acts: the columns of the network's parameters, the slopes of the line's.
cdef struct ByTheta:
    int64_t nozzle_bias
    int64_t nozzle_weight
    int64_t seat_bias
    int64_t seat_weight
    const int64_t* nozzle  # (NOZZLE_NUMBERS,)
    const int64_t* valve  # (VALVE_NUMBERS,)
    const double* valve_sizes  # of theta = 1
    const int64_t* needle  # (NEEDLE_NUMBERS,)
    const double* needle_sizes
    int64_t shots  # of an event, whose delays are two columns each behind those of theta
    int64_t first_shot  # its column
    int64_t pairs  # of coefficients and columns; those of a column follow each other
    const int64_t* columns
    const int64_t* coefficients
    const double* slopes


cdef enum:
    BY_NOZZLE = 1
    BY_SEAT = 2
    BY_LINE = 4  # or valve


# Derivatives carried with a state: of n states by m numbers, theta first; the rest is scratch.
cdef struct Tangent:
    int64_t n
    int64_t m
    int64_t size  # coefficients of the line
    const double* basis  # (CURVES, PIECES, 4, MOST_NEURONS): of the neurons
    const int64_t* neurons  # (CURVES,)
    double* by  # (n, m)
    double* moved  # (n, m)
    double* by_state  # (4, n, WIDTH), of x' by x at the stages of a lump's step
    double* by_number  # (4, n, m), of x' by the numbers of line and valve, x held
    double* by_flow  # (4, n, 2), of x' by q_H, q_S
    double* of_flows  # (4, 2, m), of q_H, q_S by the numbers of phi, x held
    const unsigned char* parts  # (m / WIDTH,): what the numbers of so many columns act by, sums of the following
    double* by_coefficient  # (n, size)
    ByTheta theta


# Flows with phi and their derivatives with respect to x_1..x_3, u_2, and what the network adds.
cdef struct FlowSlopes:
    double q_h
    double q_s
    double[3] h_x
    double[3] s_x
    double h_area
    double s_area
    double h_change  # by N_H: the flow without it
    double s_change  # by N_S
    double[NOZZLE_NUMBERS][2] h_number  # by what is learned of the nozzle, as two factors
    double[INPUTS] z  # inputs of the network


# A program of terms, and what is remembered from sample to sample; the rest is scratch.
cdef struct Forcing:
    int64_t rows
    int64_t first_of_sensor  # row from which on the program is the sensor's
    const double* program  # (rows, 2)
    double* memory  # (3 rows,): what rows remember of laws and of innovations; the stack
    double* past  # (PAST_NUMBERS,)
    double* variables  # in the order of `Variable`
    double* totals  # (TOTALS,), by `TermEquation`, in its units
    double* bias  # (2,)
    double* nozzle  # (NOZZLE_NUMBERS,)


# A sample interval under terms: inputs, model and network.
cdef struct Forced:
    Interval interval
    Knot knot
    Coefficients coefficients
    Network network


# What carries the filtered gradient d e~/d theta along; all but the state's tangent as wide as that is.
cdef struct Gradient:
    Tangent tangent
    int64_t offset  # column of theta that is the offset of the line-pressure sensor
    const double* sensor  # (SENSOR_NUMBERS, m), of the numbers of its law
    double* before  # of p_L one sample before
    double* indicated
    double* error  # of the innovation
