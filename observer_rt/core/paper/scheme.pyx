"""The paper's pair over an event, its phi three free rows unit (W tanh(V z) + b)."""

from libc.stdint cimport int64_t

from numpy import array

from observer_rt.core.model.hydraulics cimport NOZZLE_NUMBERS, nozzle_law
from observer_rt.core.model.model cimport Model, Weights, empty_if_drained, rates_at
from observer_rt.core.model.network cimport fast_tanh
from observer_rt.core.model.records cimport SAC, Coefficients, Inputs, Network, inputs_of

cdef double[NOZZLE_NUMBERS] NOTHING_LEARNED  # zeros

cdef enum:
    NEURONS = 5
    ARGUMENTS = 6
    ROWS = 3  # one output for every state

cdef double[4] AHEAD = [0.0, 0.5, 0.5, 1.0]  # of a step, the stages of RK4


cdef struct FreeWeights:
    const double* hidden  # V (5, 6)
    const double* output  # W (3, 5)
    const double* bias  # b (3,)
    double unit  # 1/s


cdef void free_fault(const double* x, Inputs u, const FreeWeights* w, double* rows) noexcept nogil:
    """phi(z) of (7) with z = [x u 1], its three rows [1/s]."""
    cdef double sigma
    cdef const double* row
    cdef int64_t neuron, i
    for i in range(<int64_t> ROWS):
        rows[i] = w.bias[i]
    for neuron in range(<int64_t> NEURONS):
        row = w.hidden + ARGUMENTS * neuron
        sigma = fast_tanh(row[0] * x[0] + row[1] * x[1] + row[2] * x[2] + row[3] * u.rail + row[4] * u.area + row[5])
        for i in range(<int64_t> ROWS):
            rows[i] += w.output[NEURONS * i + neuron] * sigma
    for i in range(<int64_t> ROWS):
        rows[i] *= w.unit


cdef double balanced_rate(double x_3, double u_2, double phi_1, const Coefficients* c) noexcept nogil:
    """Q_H^ [m3/s] by the nozzle balance (Q_0/a_1)(a_2 root(x^3) - phi_1): phi_1 is the flow the model lacks.

    The orifice law at x^3 alone is not the injection rate of a worn nozzle.
    """
    line = &c.line.lump
    return c.flow_scale / line.a1 * (line.a2_nozzle * nozzle_law(x_3, u_2, NOTHING_LEARNED, &c.nozzle) - phi_1)


# What RK4 integrates: x^ with phi, or x~ pulled by the measured line pressure.
cdef struct System:
    const Coefficients* coefficients
    const Network* nominal  # says phi = 0
    const FreeWeights* phi  # NULL: none
    double gain  # l [1/s] of x~; 0 of x^


cdef inline void _rates(const double* x, Inputs u, double y, const System* s, double* rate) noexcept nogil:
    """x^' of (26), or x~' of (5), with the plus sign."""
    cdef double[ROWS] rows
    cdef int64_t i
    rates_at(x, u, s.coefficients, s.nominal, rate)
    if s.phi != NULL:
        free_fault(x, u, s.phi, rows)
        for i in range(<int64_t> ROWS):
            rate[i] += rows[i]
    else:
        rate[0] = rate[0] + s.gain * (y - x[0])


cdef void _integrate(
    double* x, Inputs start, Inputs end, double y_start, double y_end, double interval, int64_t steps, const System* s
) noexcept nogil:
    """RK4 steps over an interval [s], x (n,) in place; inputs and measured pressure are linear between the samples."""
    cdef double[4][4] rate
    cdef double[4] predicted
    cdef double step = interval / steps, share
    cdef int64_t i, j, stage, n = s.coefficients.states
    for i in range(steps):
        for stage in range(4):
            for j in range(n):
                predicted[j] = x[j] + AHEAD[stage] * step * rate[stage - 1][j] if stage > 0 else x[j]
            share = (i + AHEAD[stage]) / <double> steps
            _rates(predicted, _between(start, end, share), y_start + share * (y_end - y_start), s, rate[stage])
        for j in range(n):
            x[j] = x[j] + step / 6.0 * ((rate[0][j] + 2.0 * (rate[1][j] + rate[2][j])) + rate[3][j])
    if s.phi == NULL:
        empty_if_drained(x, start.area, end.area, NULL)


cdef inline Inputs _between(Inputs start, Inputs end, double share) noexcept nogil:
    cdef double area = max(start.area + share * (end.area - start.area), 0.0)
    return inputs_of(start.rail + share * (end.rail - start.rail), area)


cdef class _Lent:
    """A `scheme.FreeNetwork`, lent."""

    cdef FreeWeights weights
    cdef tuple arrays

    def __init__(self, network) -> None:
        cdef const double[:, ::1] hidden = network.hidden, output = network.output
        cdef const double[::1] bias = network.bias
        if hidden.shape[0] != NEURONS or hidden.shape[1] != ARGUMENTS or output.shape[0] != ROWS or bias.shape[0] != ROWS:
            raise ValueError("arrays of the free network do not fit each other")
        self.weights.hidden, self.weights.output = &hidden[0, 0], &output[0, 0]
        self.weights.bias, self.weights.unit = &bias[0], network.unit
        self.arrays = (network.hidden, network.output, network.bias)


def sweep(window, setting, network, result) -> None:
    """One pass over an event with fixed weights (10) into `result`, a `scheme.EventPass`.

    x~ starts from the window's state. x^ is x~ up to the opening and, with an empty sac, once the needle has long
    been shut again; in between it runs open loop on phi.
    """
    cdef Model model = Model(setting.coefficients)
    cdef Weights nominal = Weights(setting.nominal)
    cdef _Lent lent = _Lent(network)
    cdef const double[:, :] inputs = window.inputs
    cdef const double[:] output = window.output
    cdef const unsigned char[:] resting = window.resting.view("u1")
    cdef double[:, ::1] of_x = result.x, of_phi = result.phi
    cdef double[::1] rate = result.rate, error = result.error
    cdef unsigned char[::1] of_driven = result.driven.view("u1")
    cdef int64_t n = model.coefficients.states, k, i, opening = window.opening, steps = setting.substeps
    cdef double interval = setting.interval
    cdef double[::1] x_tilde = array(window.start[:n]), x = array(window.start[:n])
    cdef System identification, observation
    cdef Inputs start, u
    cdef bint opened = False, driven
    cdef double[3] phi
    if n > 4:
        raise ValueError("the paper's scheme knows the lump only")
    identification.coefficients = observation.coefficients = &model.coefficients
    identification.nominal = observation.nominal = &nominal.network
    identification.phi, identification.gain = NULL, setting.gain
    observation.phi, observation.gain = &lent.weights, 0.0
    with nogil:
        for k in range(output.shape[0]):
            u = inputs_of(inputs[k, 0], inputs[k, 1])
            opened = opened or k >= opening
            driven = opened and resting[k] == 0
            if k > 0:
                start = inputs_of(inputs[k - 1, 0], inputs[k - 1, 1])
                _integrate(&x_tilde[0], start, u, output[k - 1], output[k], interval, steps, &identification)
                if driven:
                    _integrate(&x[0], start, u, 0.0, 0.0, interval, steps, &observation)
            if resting[k] != 0:
                x_tilde[SAC] = 0.0
            if not driven:
                for i in range(n):
                    x[i] = x_tilde[i]
            phi[0] = phi[1] = phi[2] = 0.0
            rate[k] = 0.0
            if driven:
                u.area = max(u.area, 0.0)
                free_fault(&x[0], u, &lent.weights, phi)
                rate[k] = balanced_rate(x[SAC], u.area, phi[0], &model.coefficients)
            for i in range(3):
                of_x[k, i], of_phi[k, i] = x[i], phi[i]
            error[k] = output[k] - x_tilde[0]
            of_driven[k] = driven
