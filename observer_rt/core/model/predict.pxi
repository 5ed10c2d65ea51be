# A step of the identification system x~: prediction by the model with phi and by the sensor, then correction.


cdef double predict(
    double* x, double* indicated, const Forced* forced, double late, const double* sensor, Gradient* gradient
) noexcept nogil:
    """Advance x (n,) and the indicated pressure by one sample, in place; returns the pressure that is recorded.

    Terms of the sensor are not in it. sensor: numbers of its law (SENSOR_NUMBERS,); gradient: advanced with x, NULL: none.
    """
    cdef double lag = sensor[0], before = x[0], indicated_before = indicated[0], moved, shown
    cdef LaggedSlopes slopes
    c, interval = &forced.coefficients, &forced.interval
    if gradient == NULL:
        begin_mean(x, NULL, c)
        advance_over(x, interval, forced.knot, c, &forced.network, NULL)
        moved = lagged(indicated_before, before, x[0], interval.length, lag)
    else:
        memcpy(gradient.before, gradient.tangent.by, gradient.tangent.m * sizeof(double))
        begin_mean(x, &gradient.tangent, c)
        advance_over(x, interval, forced.knot, c, &forced.network, &gradient.tangent)
        moved = lagged(indicated_before, before, x[0], interval.length, lag)
        slopes = lagged_slopes(indicated_before, before, x[0], interval.length, lag)
        _predict_gradient(gradient, &slopes, late, interval.length, lag, moved - indicated_before, c.is_mean)
    indicated[0] = moved
    if c.is_mean:
        shown = recorded_mean(indicated_before, moved, x[c.states - 1] / interval.length, lag / interval.length, late)
    else:
        shown = recorded(indicated_before, moved, late)
    if gradient != NULL:
        _add_gain(gradient, sensor[SENSOR_GAIN], shown)
    return (1.0 + sensor[SENSOR_GAIN]) * shown


cdef void _predict_gradient(
    Gradient* g, const LaggedSlopes* slopes, double late, double interval, double lag, double rise, bint is_mean
) noexcept nogil:
    """Advance the gradient through the sensor by its slopes; rise: of the indicated pressure in this sample."""
    cdef const double* first = g.tangent.by
    cdef const double* last = g.tangent.by + (g.tangent.n - 1) * g.tangent.m
    cdef double before, predicted, integrated, shown, lag_share = lag / interval
    cdef int64_t j, number
    for j in range(g.tangent.m):
        before = g.indicated[j]
        predicted = slopes.by_indicated * before + slopes.by_start * g.before[j] + slopes.by_end * first[j]
        for number in range(<int64_t> SENSOR_NUMBERS):
            predicted = predicted + slopes.by_number[number] * g.sensor[number * g.tangent.m + j]
        if is_mean:
            integrated = last[j] - rise * g.sensor[j]
            shown = recorded_mean(before, predicted, integrated / interval, lag_share, late)
        else:
            shown = recorded(before, predicted, late)
        g.error[j] = -1.0 * shown
        g.indicated[j] = predicted


cdef inline void _add_gain(Gradient* g, double gain, double shown) noexcept nogil:
    """Add gain and offset of the sensor to the gradient of the innovation; shown: pressure recorded at a gain of 0."""
    cdef int64_t j
    for j in range(g.tangent.m):
        g.error[j] = (1.0 + gain) * g.error[j] - shown * g.sensor[SENSOR_GAIN * g.tangent.m + j]
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
    """Add a multiple of values (count,) to a result."""
    cdef int64_t j
    for j in range(count):
        result[j] = result[j] + factor * values[j]
