# A sample interval of any line, (19)-(22) of a lump or its like of a pipe: a new kind of line is a file, and a branch
# wherever the kind is asked for.

include "servo.pxi"
include "lump.pxi"
include "wave.pxi"
include "closed_end.pxi"

# Kinds of line.
cpdef enum:
    LUMP = 0
    WAVE = 1


cdef void advance_over(
    double* x, const Interval* interval, Knot knot, const Coefficients* c, const Network* network, Tangent* t
) noexcept nogil:
    """Move the state x (n,) by a sample interval, in place, in which the area may bend at a knot.

    knot: the share (0..1) of the interval it comes after, and the normalised area there; a share of 0: no
    bend, nor where the needle is shut all through the interval. t: the tangent that moves with it, NULL for none.
    """
    if c.kind == LUMP and c.is_mean:
        if t == NULL:
            _advance_lump(x, interval, knot, c, network, NULL, MEAN_STATES)
        else:
            _advance_lump(x, interval, knot, c, network, t, MEAN_STATES)
    elif c.kind == LUMP:
        if t == NULL:
            _advance_lump(x, interval, knot, c, network, NULL, LUMP_STATES)
        else:
            _advance_lump(x, interval, knot, c, network, t, LUMP_STATES)
    else:
        leapfrog(x, interval, knot, c, network, t)


cdef void fine_step(
    double* x, Inputs start, Inputs middle, Inputs end, double step, const Coefficients* c, const Network* network
) noexcept nogil:
    """Move the state by a single step [s], in place, whose inputs are known in its middle, too."""
    if c.kind == LUMP and c.is_mean:
        _runge_kutta_step(x, start, middle, end, step, c, network, NULL, MEAN_STATES)
    elif c.kind == LUMP:
        _runge_kutta_step(x, start, middle, end, step, c, network, NULL, LUMP_STATES)
    else:
        move_line(x, start.rail, step, c, NULL)
        move_end(x, middle, end, step, c, network, NULL)


cdef void rates_at(const double* x, Inputs u, const Coefficients* c, const Network* network, double* rate) noexcept nogil:
    """x' [1/s] of a lump, (3,) or with its mean (4,): see `right_hand_side`."""
    right_hand_side(x, u, c, network, rate, <int> c.states)


cdef void rest_line(double* x, double pressure, const Coefficients* c) noexcept nogil:
    """Set a line to rest at a normalised pressure, without flow; p_S is left."""
    cdef int64_t i
    if c.kind == LUMP:
        x[0], x[1] = pressure, 0.0
        return
    for i in range(1, c.cells + 1):
        x[pressure_at(i, c.cells)] = pressure
        x[flow_at(i, c.cells)] = 0.0
    x[before_at(c.cells)] = pressure
    for i in range(<int64_t> MEMORIES):
        x[memory_at(i, c.cells)] = 0.0


cdef void begin_mean(double* x, Tangent* t, const Coefficients* c) noexcept nogil:
    """Let the integral of p_L, where a line has it, begin anew in x (n,), and in the tangent, if there is one."""
    if c.is_mean:
        x[c.states - 1] = 0.0
        if t != NULL:
            memset(t.by + (t.n - 1) * t.m, 0, t.m * sizeof(double))
