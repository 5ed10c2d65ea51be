"""The paper's scheme: three free rows phi = unit (W tanh(V z) + b), its pair over an event, cost and gradient."""

from libc.math cimport INFINITY, fabs, isfinite
from libc.stdint cimport int64_t
from libc.string cimport memcpy, memset

from numpy import array, zeros

from observer_rt.core.model.hydraulics cimport NOZZLE_NUMBERS, nozzle_law
from observer_rt.core.model.model cimport Model, Weights, empty_sac, rates_at
from observer_rt.core.model.network cimport fast_tanh
from observer_rt.core.model.records cimport SAC, Coefficients, Inputs, Interval, Knot, Network
from observer_rt.core.stream.stepper cimport CarriedPhi

cdef double[NOZZLE_NUMBERS] NOTHING_LEARNED  # zeros

cdef enum:
    NEURONS = 5
    ARGUMENTS = 6
    ROWS = 3  # one output for every state
    HIDDEN_END = 30  # of theta: V, then W, then b
    OUTPUT_END = 45
    WEIGHTS = 48
    LANES = 8  # samples reckoned together

cdef double EMPTY_SAC = 1e-7  # of p_0: a shut, drained sac this close to chamber pressure is at it


cdef struct FreeWeights:
    const double* hidden  # V (5, 6)
    const double* output  # W (3, 5)
    const double* bias  # b (3,)
    double unit  # 1/s


cdef void free_fault(const double* x, Inputs u, const FreeWeights* w, double* rows) noexcept nogil:
    """phi(z) of (7) with z = [x u 1], its three rows [1/s]."""
    cdef double first = w.bias[0], second = w.bias[1], third = w.bias[2], sigma
    cdef const double* row
    cdef int64_t neuron
    for neuron in range(<int64_t> NEURONS):
        row = w.hidden + ARGUMENTS * neuron
        sigma = fast_tanh(
            row[0] * x[0] + row[1] * x[1] + row[2] * x[2] + row[3] * u.rail + row[4] * u.area + row[5]
        )
        first += w.output[neuron] * sigma
        second += w.output[NEURONS + neuron] * sigma
        third += w.output[2 * NEURONS + neuron] * sigma
    rows[0], rows[1], rows[2] = w.unit * first, w.unit * second, w.unit * third


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
    cdef double[3] rows
    rates_at(x, u, s.coefficients, s.nominal, rate)
    if s.phi != NULL:
        free_fault(x, u, s.phi, rows)
        rate[0] += rows[0]
        rate[1] += rows[1]
        rate[2] += rows[2]
    else:
        rate[0] = rate[0] + s.gain * (y - x[0])


cdef void _integrate(
    double* x, Inputs start, Inputs end, double y_start, double y_end, double interval, int64_t steps, const System* s
) noexcept nogil:
    """RK4 steps over an interval [s], x (n,) in place; inputs and measured pressure are linear between the samples."""
    cdef double[4] first
    cdef double[4] second
    cdef double[4] third
    cdef double[4] fourth
    cdef double[4] there
    cdef double step = interval / steps, count = <double> steps, y_0, y_1, y_2
    cdef Inputs u_0, u_1, u_2
    cdef int64_t i, j, n = s.coefficients.states
    for i in range(steps):
        u_0, u_1 = _between(start, end, i / count), _between(start, end, (i + 0.5) / count)
        u_2 = _between(start, end, (i + 1.0) / count)
        y_0, y_1 = y_start + i / count * (y_end - y_start), y_start + (i + 0.5) / count * (y_end - y_start)
        y_2 = y_start + (i + 1.0) / count * (y_end - y_start)
        _rates(x, u_0, y_0, s, first)
        for j in range(n):
            there[j] = x[j] + 0.5 * step * first[j]
        _rates(there, u_1, y_1, s, second)
        for j in range(n):
            there[j] = x[j] + 0.5 * step * second[j]
        _rates(there, u_1, y_1, s, third)
        for j in range(n):
            there[j] = x[j] + step * third[j]
        _rates(there, u_2, y_2, s, fourth)
        for j in range(n):
            x[j] = x[j] + step / 6.0 * ((first[j] + 2.0 * (second[j] + third[j])) + fourth[j])
    if s.phi == NULL and start.area <= 0.0 and end.area <= 0.0 and fabs(x[SAC]) < EMPTY_SAC:
        empty_sac(x, NULL)


cdef inline Inputs _between(Inputs start, Inputs end, double share) noexcept nogil:
    cdef Inputs u
    u.rail = start.rail + share * (end.rail - start.rail)
    u.area = max(start.area + share * (end.area - start.area), 0.0)
    return u


# The free rows as x^ carries them, and arrays in which others are posted, of one slot after another.
cdef struct Free:
    FreeWeights weights
    double* hidden
    double* output
    double* bias
    double* unit
    const double* posted_hidden
    const double* posted_output
    const double* posted_bias
    const double* posted_unit


cdef class FreePhi(CarriedPhi):
    """The free rows as what x^ carries: arrays of a `learner.FreePhi`, and those in which others are posted."""

    cdef Free free
    cdef tuple lent

    def __init__(self, phi, posted) -> None:
        cdef double[:, ::1] hidden = phi.hidden, output = phi.output
        cdef double[::1] bias = phi.bias, unit = phi.unit
        cdef const double[:, :, ::1] posted_hidden = posted.hidden, posted_output = posted.output
        cdef const double[:, ::1] posted_bias = posted.bias, posted_unit = posted.unit
        fits = hidden.shape[0] == NEURONS and hidden.shape[1] == ARGUMENTS and output.shape[0] == ROWS
        if not fits or output.shape[1] != NEURONS or bias.shape[0] != ROWS or unit.shape[0] != 1:
            raise ValueError("arrays of the free network do not fit each other")
        self.lent = (phi, posted)
        f = &self.free
        f.hidden, f.output, f.bias, f.unit = &hidden[0, 0], &output[0, 0], &bias[0], &unit[0]
        f.posted_hidden, f.posted_output = &posted_hidden[0, 0, 0], &posted_output[0, 0, 0]
        f.posted_bias, f.posted_unit = &posted_bias[0, 0], &posted_unit[0, 0]
        f.weights.hidden, f.weights.output, f.weights.bias, f.weights.unit = f.hidden, f.output, f.bias, f.unit[0]
        self.advance, self.read, self.put, self.phi = _advance_free, _read_free, _put_free, f


cdef void _advance_free(
    void* phi, double* x, const Interval* interval, Knot knot, const Coefficients* c, const Network* network
) noexcept nogil:
    cdef System s
    s.coefficients, s.nominal, s.phi, s.gain = c, network, &(<Free*> phi).weights, 0.0
    _integrate(x, interval.start, interval.end, 0.0, 0.0, interval.length, interval.substeps, &s)


cdef double _read_free(
    void* phi, const double* x, Inputs u, const Coefficients* c, const Network* network, double* rows
) noexcept nogil:
    free_fault(x, u, &(<Free*> phi).weights, rows)
    return balanced_rate(x[SAC], u.area, rows[0], c)


cdef void _put_free(void* phi, int64_t slot) noexcept nogil:
    f = <Free*> phi
    memcpy(f.hidden, f.posted_hidden + slot * NEURONS * ARGUMENTS, NEURONS * ARGUMENTS * sizeof(double))
    memcpy(f.output, f.posted_output + slot * ROWS * NEURONS, ROWS * NEURONS * sizeof(double))
    memcpy(f.bias, f.posted_bias + slot * ROWS, ROWS * sizeof(double))
    f.unit[0] = f.weights.unit = f.posted_unit[slot]


cdef class _Lent:
    """A `network.FreeNetwork`, lent."""

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


def fault_of(x, u, network) -> tuple[float, float, float]:
    """phi(z) of (7) with z = [x u 1], its three rows [1/s]; x (3,), u (2,), a `FreeNetwork`."""
    cdef _Lent lent = _Lent(network)
    cdef double[3] state
    cdef double[3] rows
    cdef Inputs inputs
    state[0], state[1], state[2] = x[0], x[1], x[2]
    inputs.rail, inputs.area = u
    free_fault(state, inputs, &lent.weights, rows)
    return rows[0], rows[1], rows[2]


def rate_by_balance(double x_3, double u_2, double phi_1, coefficients) -> float:
    """Q_H^ [m3/s] by the nozzle balance."""
    cdef Model model = Model(coefficients)
    return balanced_rate(x_3, u_2, phi_1, &model.coefficients)


def sweep(window, setting, network, result) -> None:
    """One pass over an event with fixed weights (10) into `result`, a `systems.EventPass`.

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
            u.rail, u.area = inputs[k, 0], inputs[k, 1]
            opened = opened or k >= opening
            driven = opened and resting[k] == 0
            if k > 0:
                start.rail, start.area = inputs[k - 1, 0], inputs[k - 1, 1]
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


# Loops run along the samples, and sums go by lanes of eight: the compiler makes vectors of the innermost loops.

cdef void _add_weighted(double* sums, const double* values, double weight, int64_t n) noexcept nogil:
    cdef int64_t k
    for k in range(n):
        sums[k] = sums[k] + weight * values[k]


cdef void _tanh_of(double* values, int64_t n) noexcept nogil:
    cdef int64_t k
    for k in range(n):
        values[k] = fast_tanh(values[k])


cdef void _add_products(double* total, const double* one, const double* other, int64_t n) noexcept nogil:
    """Adds products to the lanes of `total` (8,)."""
    cdef double[LANES] sums
    cdef int64_t first, lane
    memcpy(sums, total, sizeof(sums))
    for first in range(0, n, 8):
        for lane in range(<int64_t> LANES):
            sums[lane] = sums[lane] + one[first + lane] * other[first + lane]
    memcpy(total, sums, sizeof(sums))


cdef double _of_lanes(const double* total) noexcept nogil:
    cdef double result = total[0]
    cdef int64_t lane
    for lane in range(1, <int64_t> LANES):
        result = result + total[lane]
    return result


cdef class FaultCost:
    """The cost (10) of a training as the minimiser wants it: the sum of eps'eps/2, eps = target - phi in its unit.

    n samples and as many more as fill vectors, all along the rows. z: (6, n) columns [x^ u 1]; target: (3, n) of phi, in
    units of the network; counts: (n,) 1, or 0 where there is no sample.
    """

    cdef const double[:, ::1] z, target
    cdef const double[::1] counts
    cdef double[:, ::1] sigmas, errors  # of the theta whose value was asked for last
    cdef double[::1] backs  # errors propagated back through a neuron
    cdef int64_t n

    def __init__(self, z, target, counts) -> None:
        self.z, self.target, self.counts = z, target, counts
        self.n = self.counts.shape[0]
        if self.n % LANES or z.shape != (ARGUMENTS, self.n) or target.shape != (ROWS, self.n):
            raise ValueError("samples do not fit each other, or vectors")
        self.sigmas, self.errors, self.backs = zeros((NEURONS, self.n)), zeros((ROWS, self.n)), zeros(self.n)

    def value(self, const double[::1] theta) -> float:
        """J at theta (48,); inf where it is not finite."""
        cdef double[LANES] total
        cdef double* here
        cdef double weight, result
        cdef int64_t k, neuron, row, j
        _require(theta)
        with nogil:
            memset(total, 0, sizeof(total))
            for neuron in range(<int64_t> NEURONS):
                here, weight = &self.sigmas[neuron, 0], theta[neuron * ARGUMENTS]
                for k in range(self.n):
                    here[k] = weight * self.z[0, k]
                for j in range(1, <int64_t> ARGUMENTS):
                    _add_weighted(here, &self.z[j, 0], theta[neuron * ARGUMENTS + j], self.n)
                _tanh_of(here, self.n)
            for row in range(<int64_t> ROWS):
                here, weight = &self.errors[row, 0], theta[OUTPUT_END + row]
                for k in range(self.n):
                    here[k] = weight
                for neuron in range(<int64_t> NEURONS):
                    _add_weighted(here, &self.sigmas[neuron, 0], theta[HIDDEN_END + row * NEURONS + neuron], self.n)
                for k in range(self.n):
                    here[k] = self.counts[k] * (self.target[row, k] - here[k])
            for k in range(0, self.n, 8):
                for row in range(<int64_t> ROWS):
                    _add_products(total, &self.errors[row, k], &self.errors[row, k], 8)
            result = 0.5 * _of_lanes(total)
        return result if isfinite(result) else INFINITY

    def gradient(self, const double[::1] theta) -> NDArray[np.float64]:
        """Gradient (48,) of J at the theta whose value was asked for last, in the order of `network.free_network`.

        (13) prints the slope of sigma_i as (sigma_i + 1)^2 / exp(2 v_i z), which is 1 - sigma_i^2 of tanh (9).
        """
        found = zeros(WEIGHTS)
        cdef double[::1] gradient = found
        cdef double[LANES] total
        cdef const double* sigma
        cdef double* back = &self.backs[0]
        cdef int64_t k, neuron, row, j, place, lane
        _require(theta)
        with nogil:
            for row in range(<int64_t> ROWS):
                memset(total, 0, sizeof(total))
                for k in range(0, self.n, 8):
                    for lane in range(<int64_t> LANES):
                        total[lane] = total[lane] + self.errors[row, k + lane]
                gradient[OUTPUT_END + row] = -_of_lanes(total)
            for neuron in range(<int64_t> NEURONS):
                sigma = &self.sigmas[neuron, 0]
                memset(back, 0, self.n * sizeof(double))
                for row in range(<int64_t> ROWS):
                    place = HIDDEN_END + row * NEURONS + neuron
                    _add_weighted(back, &self.errors[row, 0], theta[place], self.n)
                    memset(total, 0, sizeof(total))
                    _add_products(total, &self.errors[row, 0], sigma, self.n)
                    gradient[place] = -_of_lanes(total)
                for k in range(self.n):
                    back[k] = back[k] * (1.0 - sigma[k] * sigma[k])
                for j in range(<int64_t> ARGUMENTS):
                    memset(total, 0, sizeof(total))
                    _add_products(total, back, &self.z[j, 0], self.n)
                    gradient[neuron * ARGUMENTS + j] = -_of_lanes(total)
        return found


cdef int _require(const double[::1] theta) except -1:
    if theta.shape[0] != WEIGHTS:
        raise ValueError("theta has other weights")
    return 0


def add_two_products(
    double[:, ::1] matrix, const double[::1] a, const double[::1] b, const double[::1] c, const double[::1] d
) -> None:
    """Adds a b' + c d' of vectors (m,) to `matrix` (m, m), in place."""
    cdef int64_t i, j, m = matrix.shape[0]
    if not (matrix.shape[1] == a.shape[0] == b.shape[0] == c.shape[0] == d.shape[0] == m):
        raise ValueError("matrix and vectors do not fit each other")
    for i in range(m):
        for j in range(m):
            matrix[i, j] = matrix[i, j] + (a[i] * b[j] + c[i] * d[j])
