# Crosstalk: what the line pressure adds to the recorded lift of a shut needle, found by regression at standstill.

cdef enum:
    CROSSTALK_SAMPLES = 2000

cdef double LEAST_SWING = 0.5e6  # Pa about the mean, below which a sample is hum and does not count
cdef double FADE = 2e-5  # share of the sums that is forgotten with every sample
cdef double FOUND = 8.0  # standard deviations of the slope from which on it is subtracted
cdef double LOST = 5.0  # standard deviations below which it no longer is
cdef double FADE_LATELY = 4e-3  # the same share, of sums over the last samples only
cdef double GONE = 6.0  # standard deviations between both slopes that show a change
cdef double SHARE_LEFT = 0.5  # of the crosstalk: where the last samples show less, it has gone
cdef double LEAST_NOISE = 0.1e-6  # m
cdef double MOST_CROSSTALK = 0.5e-12  # m/Pa
cdef double _WRONG_SWING = 50e6  # Pa, beyond which the rail has jumped or the value is no number


cdef inline double _swing(Observer* observer, double line_pressure) noexcept nogil:
    """Deviation of the line pressure from its running mean, which starts again after a jump."""
    regression = &observer.memory.crosstalk
    swing = line_pressure - regression.line_mean
    if abs(swing) * observer.constants.pressure_scale <= _WRONG_SWING:
        return swing
    if isfinite(line_pressure):
        regression.line_mean = line_pressure
    return 0.0


cdef inline void gather_crosstalk(Observer* observer, double swing, double lift) noexcept nogil:
    """Take a shut needle's lift [m] about its zero, at a swing of the line pressure, into the regression."""
    regression = &observer.memory.crosstalk
    pressed = abs(swing) * observer.constants.pressure_scale
    if pressed > LEAST_SWING and abs(lift) < observer.memory.dead_band.lift_on + MOST_CROSSTALK * pressed:
        regression.swing_squares += swing * swing - FADE * regression.swing_squares
        regression.swing_lifts += swing * lift - FADE * regression.swing_lifts
        regression.squares_lately += swing * swing - FADE_LATELY * regression.squares_lately
        regression.lifts_lately += swing * lift - FADE_LATELY * regression.lifts_lately
        regression.count += 1


cdef void _find_crosstalk(Observer* observer) noexcept nogil:
    """Set the crosstalk to the slope of the shut needle's lift over the line pressure, 0 if it is not significant."""
    cdef bint is_there
    memory = observer.memory
    regression, resting = &memory.crosstalk, &memory.resting_lift
    if regression.count < CROSSTALK_SAMPLES:
        return
    if _is_crosstalk_gone(observer):
        _forget_crosstalk(observer)
        return
    slope = regression.swing_lifts / regression.swing_squares
    needed = FOUND if resting.crosstalk == 0.0 else LOST
    is_there = slope**2 * regression.swing_squares > needed**2 * max(memory.lift_zero.spread, LEAST_NOISE**2)
    most = MOST_CROSSTALK * observer.constants.pressure_scale
    resting.crosstalk = slope if is_there and abs(slope) < most else 0.0


cdef bint _is_crosstalk_gone(Observer* observer) noexcept nogil:
    """Whether the last samples contradict the crosstalk, as after a fault of the sensor has gone."""
    cdef bint is_another
    memory = observer.memory
    resting, regression = &memory.resting_lift, &memory.crosstalk
    if resting.crosstalk == 0.0 or regression.squares_lately == 0.0:
        return False
    lately = regression.lifts_lately / regression.squares_lately
    left = (resting.crosstalk - lately) ** 2 * regression.squares_lately
    is_another = left > GONE**2 * max(memory.lift_zero.spread, LEAST_NOISE**2)
    return is_another and lately / resting.crosstalk < SHARE_LEFT


cdef void _forget_crosstalk(Observer* observer) noexcept nogil:
    """Clear crosstalk and sums, so that the regression starts again."""
    memory = observer.memory
    regression = &memory.crosstalk
    memory.resting_lift.crosstalk = 0.0
    regression.count = 0
    regression.swing_squares = regression.swing_lifts = regression.squares_lately = regression.lifts_lately = 0.0
