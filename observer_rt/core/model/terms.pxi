# Terms as one program, run without compiling anything anew for another law: see model.terms.term.
#
# A program is postfix: rows (operation, operand), the end of a term adds what is on the stack to its equation's total.

cdef enum:  # Operation of a law on one or two arguments
    OP_ADD, OP_SUBTRACT, OP_MULTIPLY, OP_DIVIDE
    OP_POWER  # the exponent is a number
    OP_GREATER, OP_LESS  # 0 or 1
    OP_NEGATE
    OP_SQRT  # with the sign of its argument
    OP_ABS, OP_EXP, OP_LOG, OP_SIN, OP_COS, OP_TANH, OP_MIN, OP_MAX

cpdef enum:  # what a program has beside
    OP_NUMBER = 17  # operand: the value
    OP_VARIABLE = 18  # which
    OP_LAG = 19  # ms
    OP_RINGING = 20  # behind two numbers, frequency in kHz and damping
    OP_END = 21  # of a term of this equation

cdef enum:  # `Variable`
    VARIABLE_RAIL_PRESSURE, VARIABLE_LINE_PRESSURE, VARIABLE_SAC_PRESSURE, VARIABLE_CHAMBER_PRESSURE
    VARIABLE_LINE_FLOW, VARIABLE_SEAT_FLOW, VARIABLE_NOZZLE_FLOW, VARIABLE_LIFT, VARIABLE_MAX_LIFT
    VARIABLE_LIFT_RATE, VARIABLE_RAIL_RATE, VARIABLE_LINE_RATE, VARIABLE_SINCE_OPENING, VARIABLE_TIME
    VARIABLE_INJECTION_NUMBER, VARIABLE_OPEN, VARIABLE_CLOSED, VARIABLE_OPENING, VARIABLE_CLOSING, VARIABLES

cdef enum:  # `TermEquation`
    EQUATION_LINE_FLOW, EQUATION_LINE_PRESSURE, EQUATION_SEAT_FLOW, EQUATION_NOZZLE_FLOW, EQUATION_STIFFNESS
    EQUATION_INERTANCE, EQUATION_CHAMBER_PRESSURE, EQUATION_SENSOR, EQUATION_NEEDLE_LIFT, EQUATION_RAIL_PRESSURE

cdef double DAMPED = 0.99  # of what rings no more
# By equation, in its units: beyond that no term, and no sum of terms, goes.
cdef double[TOTALS] LOWEST_TOTAL = [-30.0, -15.0, -0.8, -0.6, -0.6, -0.6, -20.0, -10.0, -0.1, -10.0]
cdef double[TOTALS] HIGHEST_TOTAL = [30.0, 15.0, 0.8, 0.6, 0.6, 4.0, 20.0, 10.0, 0.1, 10.0]


cdef int64_t sensor_rows(const double* program, int64_t rows) noexcept nogil:
    """From which row on a program is the sensor's."""
    cdef int64_t first = 0, row
    for row in range(rows):
        if program[2 * row] == OP_END and program[2 * row + 1] != EQUATION_SENSOR:
            first = row + 1
    return first


cdef bint reads(const double* program, int64_t rows, int64_t variable) noexcept nogil:
    """Whether a law of a program has this variable."""
    cdef int64_t row
    for row in range(rows):
        if program[2 * row] == OP_VARIABLE and program[2 * row + 1] == variable:
            return True
    return False


cdef void run_program(
    const double* program, int64_t first, int64_t end, int64_t rows, const double* variables, double* memory,
    double interval_ms, double* totals
) noexcept nogil:
    """Terms from one row up to another at one moment, added up by equation into `totals` (10,).

    variables: in the order and units of `Variable`, totals: of `TermEquation`. memory (3 rows,); what it remembers
    moves on by `interval_ms`, at 0 it stays. Every term, and every total, is held within its equation's bounds; a
    term that is not finite is 0.
    """
    cdef int64_t top = 3 * rows  # the stack grows downwards, from the end
    cdef int64_t row, operation, place
    cdef double operand
    memset(totals, 0, TOTALS * sizeof(double))
    for row in range(first, end):
        operation, operand = <int64_t> program[2 * row], program[2 * row + 1]
        if operation == OP_NUMBER:
            top -= 1
            memory[top] = operand
        elif operation == OP_VARIABLE:
            top -= 1
            memory[top] = variables[<int64_t> operand]
        elif operation == OP_LAG:
            memory[row] = memory[top] = _lagged_by(memory[row], memory[top], interval_ms / operand)
        elif operation == OP_RINGING:
            top += 2
            memory[top] = _rung(memory + row - 2, memory[top], memory[top - 1], memory[top - 2], interval_ms)
        elif operation == OP_END:
            place = <int64_t> operand
            totals[place] = _held(totals[place] + _held(memory[top], place), place)
            top += 1
        elif operation <= OP_LESS or operation >= OP_MIN:
            memory[top + 1] = _of_two(operation, memory[top + 1], memory[top])
            top += 1
        else:
            memory[top] = _of_one(operation, memory[top])


cdef double without_ringing(
    const double* program, int64_t first, int64_t rows, double* memory, double innovation, double interval_ms
) noexcept nogil:
    """An innovation behind a notch at the frequency of every resonance of the sensor, whose rows begin at `first`."""
    cdef int64_t row, place
    cdef double kilohertz, damping, swing
    for row in range(first, rows):
        if program[2 * row] == OP_RINGING:
            kilohertz, damping, place = program[2 * row - 3], program[2 * row - 1], rows + row - 2
            _rung(memory + place, innovation, kilohertz, DAMPED, interval_ms)
            swing = memory[place + 2] / (2.0 * pi * kilohertz)
            innovation -= 2.0 * (DAMPED - damping) * swing
    return innovation


cdef double _lagged_by(double before, double now, double intervals) noexcept nogil:
    """A lag's next value; one that is not a number is begun anew."""
    if not isfinite(before):
        return now
    return before - expm1(-intervals) * (now - before)


cdef double _rung(double* memory, double now, double kilohertz, double damping, double interval_ms) noexcept nogil:
    """The oscillation that a resonance adds at the end of an interval, over which its input is a straight line.

    memory: the input, what is added to it, and how fast the sum changes; begun anew where one is not finite.
    """
    cdef double before = memory[0], added = memory[1], change = memory[2]
    cdef double turn, fade, swing, slope, steady, off, rate, left, cosine, sine
    if not isfinite(before + added + change):
        added, change = 0.0, 0.0
    elif interval_ms > 0.0:
        turn = 2.0 * pi * kilohertz
        fade, swing = damping * turn, turn * sqrt(1.0 - damping * damping)
        slope = (now - before) / interval_ms
        steady = -2.0 * damping / turn * slope  # where it would settle on this line
        off, rate = added - steady, change - slope
        left = exp(-fade * interval_ms)
        cosine, sine = cos(swing * interval_ms), sin(swing * interval_ms) / swing
        added = steady + left * (off * cosine + (rate + fade * off) * sine)
        change = slope + left * (rate * cosine - (turn * turn * off + fade * rate) * sine)
    memory[0], memory[1], memory[2] = now, added, change
    return added


cdef inline double _held(double value, int64_t equation) noexcept nogil:
    if not isfinite(value):
        return 0.0
    return min(max(value, LOWEST_TOTAL[equation]), HIGHEST_TOTAL[equation])


cdef double _of_two(int64_t operation, double a, double b) noexcept nogil:
    if operation == OP_ADD:
        return a + b
    if operation == OP_SUBTRACT:
        return a - b
    if operation == OP_MULTIPLY:
        return a * b
    if operation == OP_DIVIDE:
        if b != 0.0:
            return a / b
        if a == 0.0 or isnan(a):
            return NAN
        return copysign(INFINITY, a) * copysign(1.0, b)
    if operation == OP_POWER:
        return a * a if b == 2.0 else pow(a, b)
    if operation == OP_GREATER:
        return 1.0 if a > b else 0.0
    if operation == OP_LESS:
        return 1.0 if a < b else 0.0
    if isnan(a) or isnan(b):
        return NAN
    return min(a, b) if operation == OP_MIN else max(a, b)


cdef double _of_one(int64_t operation, double a) noexcept nogil:
    if operation == OP_NEGATE:
        return -a
    if operation == OP_SQRT:
        return copysign(sqrt(fabs(a)), a)
    if operation == OP_ABS:
        return fabs(a)
    if operation == OP_EXP:
        return exp(a)
    if operation == OP_LOG:
        return log(a)
    if operation == OP_SIN:
        return sin(a)
    if operation == OP_COS:
        return cos(a)
    return tanh(a)
