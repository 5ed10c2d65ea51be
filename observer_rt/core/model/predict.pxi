# A step of the identification system x~: prediction by the model with phi and by the sensor, then correction.


cdef double predict(
    double* x, double* indicated, const Forced* forced, double late, const double* sensor, Gradient* gradient
) noexcept nogil:
    """Advance x (n,) and the indicated pressure by one sample, in place; returns the pressure that is recorded.

    Terms of the sensor are not in it. sensor: numbers of its law (SENSOR_NUMBERS,); gradient: advanced with x, NULL: none.
    """
    cdef double lag = sensor[0], before = x[0], indicated_before = indicated[0], moved, shown
    cdef Tangent* t = NULL if gradient == NULL else &gradient.tangent
    c, interval = &forced.coefficients, &forced.interval
    if t != NULL:
        memcpy(gradient.before, t.by, t.m * sizeof(double))
    begin_mean(x, t, c)
    advance_over(x, interval, forced.knot, c, &forced.network, t)
    moved = lagged(indicated_before, before, x[0], interval.length, lag)
    indicated[0] = moved
    if c.is_mean:
        shown = recorded_mean(indicated_before, moved, x[c.states - 1] / interval.length, lag / interval.length, late)
    else:
        shown = recorded(indicated_before, moved, late)
    if gradient != NULL:
        slopes = lagged_slopes(indicated_before, before, x[0], interval.length, lag)
        _predict_gradient(gradient, &slopes, late, interval.length, sensor, moved - indicated_before, shown, c.is_mean)
    return (1.0 + sensor[SENSOR_GAIN]) * shown


cdef void _predict_gradient(
    Gradient* g, const LaggedSlopes* slopes, double late, double interval, const double* numbers, double rise,
    double shown, bint is_mean
) noexcept nogil:
    """Advance the gradient through the linear sensor by its slopes; shown: pressure recorded at a gain of 0."""
    cdef int64_t parts = g.tangent.m // WIDTH, j, number
    cdef const Columns* first = <const Columns*> g.tangent.by
    cdef const Columns* last = first + (g.tangent.n - 1) * parts
    cdef const Columns* start = <const Columns*> g.before
    cdef const Columns* sensor = <const Columns*> g.sensor
    cdef Columns* indicated = <Columns*> g.indicated
    cdef Columns* error = <Columns*> g.error
    cdef Columns before
    cdef double gain = 1.0 + numbers[SENSOR_GAIN], share = numbers[0] / interval
    cdef double by_before, by_now, by_mean = 0.0
    if is_mean:
        by_before, by_now = recorded_mean(1.0, 0.0, 0.0, share, late), recorded_mean(0.0, 1.0, 0.0, share, late)
        by_mean = recorded_mean(0.0, 0.0, 1.0, share, late) / interval
    else:
        by_before, by_now = recorded(1.0, 0.0, late), recorded(0.0, 1.0, late)
    for j in range(parts):
        before = indicated[j]
        indicated[j] = slopes.by_indicated * before + slopes.by_start * start[j] + slopes.by_end * first[j]
        for number in range(<int64_t> SENSOR_NUMBERS):
            indicated[j] = indicated[j] + slopes.by_number[number] * sensor[number * parts + j]
        error[j] = -gain * (by_before * before + by_now * indicated[j] + by_mean * (last[j] - rise * sensor[j]))
        error[j] = error[j] - shown * sensor[SENSOR_GAIN * parts + j]
    g.error[g.offset] -= 1.0


cdef void correct(double* x, double* indicated, double innovation, const double* gain, int64_t n, Gradient* g) noexcept nogil:
    """Correct x~ (n,) and the indicated pressure by a measurement, in place: x~ + K e~.

    The sign is that of an observer, though the paper prints (5) with a minus. p_S is not corrected: its place in
    `gain` (n,) holds the gain of the indicated pressure.
    """
    cdef int64_t i
    for i in range(n):
        if i != SAC:
            x[i] += gain[i] * innovation
            if g != NULL:
                _add_times(gain[i], g.error, g.tangent.by + i * g.tangent.m, g.tangent.m)
    if g != NULL:
        _add_times(gain[SAC], g.error, g.indicated, g.tangent.m)
    indicated[0] = indicated[0] + gain[SAC] * innovation


cdef inline void _add_times(double factor, const double* values, double* result, int64_t count) noexcept nogil:
    """Add a multiple of columns of a tangent (count,) to a result."""
    cdef int64_t j
    for j in range(count // <int64_t> WIDTH):
        (<Columns*> result)[j] = (<Columns*> result)[j] + factor * (<const Columns*> values)[j]
