# The feed line as a pipe in which pressure travels: cells of volume between faces with inertia, staggered, by leapfrog.
#
# x = [p_n, q_n, p_S, p_1 .. p_(n-1), q_1 .. q_(n-1), p_n a step before, w_1 .. w_k: what is remembered of the flow], and
# of a mean its integral: see model.wave_line. Flows and pressures of the line take turns, explicitly; its end and the
# sac are stepped implicitly (closed_end.pxi). What remembers is the wall friction: a boundary layer still thin.

cdef enum:
    # rows of a tangent's scratch, of which the flows' take 0 and 1
    CHANGE_ROW = 2
    BEFORE_ROW = 3

cdef double WAVE_STEP = 10e-6  # s, internal, whatever the sample period
# Rates s_k [1/s] and weights [s^-1/2] by which 2/sqrt(pi t) = sum weight_k exp(-s_k t), to 7 % from .01 to 3 ms.
cdef double[MEMORIES] FORGETTING = [296.0, 4861.0, 44730.0]
cdef double[MEMORIES] WEIGHTS = [46.75, 100.8, 297.2]


cdef inline int64_t steps_over(double interval) noexcept nogil:
    """Steps of about `WAVE_STEP` in an interval [s]."""
    return max(<int64_t> 1, <int64_t> rint(interval / WAVE_STEP))


cdef inline int64_t before_at(int64_t cells) noexcept nogil:
    """Place in x of p_n a step before."""
    return 2 * cells + 1


cdef inline int64_t memory_at(int64_t number, int64_t cells) noexcept nogil:
    """Place in x of w_(number + 1)."""
    return 2 * cells + 2 + number


cdef inline int64_t pressure_at(int64_t cell, int64_t cells) noexcept nogil:
    """Place in x of p_i, i = 1 .. n."""
    return 0 if cell == cells else 2 + cell


cdef inline int64_t flow_at(int64_t face, int64_t cells) noexcept nogil:
    """Place in x of q_i, i = 1 .. n."""
    return 1 if face == cells else 1 + cells + face


cdef inline double fading(int64_t number, double step, double* take) noexcept nogil:
    """What a step [s] keeps of w_(number + 1), and what it takes of a change of the mean flow."""
    cdef double half = 0.5 * step * FORGETTING[number]
    take[0] = 1.0 / (1.0 + half)
    return (1.0 - half) / (1.0 + half)


cdef inline double pull_in_middle(int64_t number, double step, double memory, double* by_flow) noexcept nogil:
    """Pull [1/s] in the middle of a step [s] by w_(number + 1) before it, and by the change of flow in it."""
    cdef double take, keep = fading(number, step, &take)
    cdef double half = 0.5 * memory * WEIGHTS[number]
    by_flow[0] = half * take
    return half * (1.0 + keep)


cdef inline double across_joint(double share, double far, double near) noexcept nogil:
    """Inertia of a face or compliance of a cell, a share (0 to 1) of it beyond the joint: series, or sum."""
    if share >= 1.0:
        return far
    if share <= 0.0:
        return near
    return 1.0 / (share / far + (1.0 - share) / near)


cdef inline double across_joint_slopes(double share, double far, double near, double* by_near) noexcept nogil:
    """Derivatives of `across_joint` with respect to the value far and near."""
    cdef double value, square
    if share >= 1.0:
        by_near[0] = 0.0
        return 1.0
    if share <= 0.0:
        by_near[0] = 1.0
        return 0.0
    value = across_joint(share, far, near)
    square = value * value
    by_near[0] = (1.0 - share) * square / (near * near)
    return share * square / (far * far)


cdef double mean_flow(const double* x, int64_t cells) noexcept nogil:
    cdef double total = 0.0
    cdef int64_t i
    for i in range(1, cells + 1):
        total += x[flow_at(i, cells)]
    return total / cells


cdef void mean_flow_row(Tangent* t, int64_t cells, int64_t row) noexcept nogil:
    """Write the derivatives of the mean flow into a row of the scratch."""
    cdef double* result = t.moved + row * t.m
    cdef const double* flow
    cdef double share = 1.0 / cells
    cdef int64_t i, j
    memset(result, 0, t.m * sizeof(double))
    for i in range(1, cells + 1):
        flow = t.by + flow_at(i, cells) * t.m
        for j in range(t.m):
            result[j] += share * flow[j]


cdef void drag(double* x, int64_t cells, double mean_before, double step, double memory, Tangent* t) noexcept nogil:
    """Apply friction that remembers to all flows in a step [s], by the mean in its middle, and to its memory."""
    cdef double change = mean_flow(x, cells) - mean_before, pull = 0.0, by_change = 0.0
    cdef double by_memory, by_flow, push, shift, keep, take
    cdef int64_t i, k
    for k in range(<int64_t> MEMORIES):
        by_memory = pull_in_middle(k, step, memory, &by_flow)
        pull += by_memory * x[memory_at(k, cells)]
        by_change += by_flow
    push = step / (1.0 + step * by_change)
    shift = -push * (pull + by_change * change)
    if t != NULL:
        _drag_rows(t, cells, step, memory)
    for i in range(1, cells + 1):
        x[flow_at(i, cells)] += shift
    for k in range(<int64_t> MEMORIES):
        keep = fading(k, step, &take)
        x[memory_at(k, cells)] = keep * x[memory_at(k, cells)] + take * (change + shift)


cdef void _drag_rows(Tangent* t, int64_t cells, double step, double memory) noexcept nogil:
    """Move the derivatives as `drag` does the state; BEFORE_ROW of the scratch has those of the mean flow before."""
    cdef double* change = t.moved + CHANGE_ROW * t.m
    cdef double* before = t.moved + BEFORE_ROW * t.m
    cdef double* of_row
    cdef double by_change = 0.0, by_memory, by_flow, push, shift, keep, take
    cdef int64_t i, j, k
    mean_flow_row(t, cells, CHANGE_ROW)
    for j in range(t.m):
        change[j] -= before[j]
        before[j] = 0.0  # from here on that of the pull
    for k in range(<int64_t> MEMORIES):
        by_memory = pull_in_middle(k, step, memory, &by_flow)
        by_change += by_flow
        of_row = t.by + memory_at(k, cells) * t.m
        for j in range(t.m):
            before[j] += by_memory * of_row[j]
    push = step / (1.0 + step * by_change)
    for j in range(t.m):
        before[j] = -push * (before[j] + by_change * change[j])  # the shift
        change[j] += before[j]
    for i in range(1, cells + 1):
        of_row = t.by + flow_at(i, cells) * t.m
        for j in range(t.m):
            of_row[j] += before[j]
    for k in range(<int64_t> MEMORIES):
        keep = fading(k, step, &take)
        of_row = t.by + memory_at(k, cells) * t.m
        for j in range(t.m):
            of_row[j] = keep * of_row[j] + take * change[j]


cdef double open_area(const Interval* interval, Knot knot, double first, double last, double* at_end) noexcept nogil:
    """Normalised seat area of a part (shares first to last) of an interval: its mean, and that at its end."""
    cdef double start = interval.start.area, end = interval.end.area, at_first, at_last, before
    cdef bint bends = 0.0 < knot.share < 1.0
    if start <= 0.0 and end <= 0.0 and not (bends and knot.area > 0.0):
        at_end[0] = 0.0
        return 0.0
    if not bends:
        at_first = start + first * (end - start)
        at_last = start + last * (end - start)
    else:
        at_first = _bent(start, knot, end, first)
        at_last = _bent(start, knot, end, last)
    at_end[0] = max(at_last, 0.0)
    if bends and first < knot.share < last:
        before = (knot.share - first) / (last - first)
        return before * _mean_of_open(at_first, knot.area) + (1.0 - before) * _mean_of_open(knot.area, at_last)
    return _mean_of_open(at_first, at_last)


cdef inline double _bent(double start, Knot knot, double end, double share) noexcept nogil:
    """Area at a share of an interval that bends at a knot."""
    if share <= knot.share:
        return start + share / knot.share * (knot.area - start)
    return knot.area + (share - knot.share) / (1.0 - knot.share) * (end - knot.area)


cdef inline double _mean_of_open(double first, double last) noexcept nogil:
    """Mean of max(area, 0) where the area goes straight from one to the other."""
    cdef double highest
    if first >= 0.0 and last >= 0.0:
        return 0.5 * (first + last)
    if first <= 0.0 and last <= 0.0:
        return 0.0
    highest = max(first, last)
    return 0.5 * highest * highest / fabs(last - first)


cdef void leapfrog(
    double* x, const Interval* interval, Knot knot, const Coefficients* c, const Network* network, Tangent* t
) noexcept nogil:
    """`advance_over` of a line of cells."""
    cdef int64_t steps = steps_over(interval.length), ends = max(<int64_t> 1, interval.substeps // steps), i, j
    cdef double step = interval.length / steps, part = 1.0 / (steps * ends)
    cdef double rise = interval.end.rail - interval.start.rail, share, first
    cdef Inputs mean = inputs_of(0.0, 0.0), last = inputs_of(0.0, 0.0)
    for i in range(steps):
        share = <double> i / steps
        mean.rail = last.rail = interval.start.rail + share * rise
        mean.since = last.since = interval.start.since + share * interval.length
        move_line(x, mean.rail, step, c, t)
        for j in range(ends):
            first = share + j * part
            mean.area = open_area(interval, knot, first, first + part, &last.area)
            mean.servo = between_servos(&interval.start.servo, &interval.end.servo, first + 0.5 * part)
            between_needles(&interval.start, &interval.end, first + 0.5 * part, &mean)
            between_needles(&interval.start, &interval.end, first + part, &last)
            move_end(x, mean, last, step / ends, c, network, t)
    empty_if_drained(x, interval.start.area, interval.end.area, t)


cdef void move_line(double* x, double rail, double step, const Coefficients* c, Tangent* t) noexcept nogil:
    """Move all flows by a step [s], then all pressures but that of the end cell."""
    line = &c.line.wave
    cdef int64_t cells = c.cells, i, place, here, behind, inflow, outflow
    cdef double mean_before = mean_flow(x, cells) if line.memory > 0.0 else 0.0
    cdef double ahead_flow = x[flow_at(1, cells)], ahead_pressure = rail, loss = line.loss / cells
    cdef double flow, pressure, drop, inertia, uneven, resistance, slowed, new_flow, friction, keep, push, far, near
    cdef double compliance, soft, net, by_pressure, by_air, by_slope
    cdef WaveLine* by_line
    if t != NULL and line.memory > 0.0:
        mean_flow_row(t, cells, BEFORE_ROW)
    for i in range(1, cells + 1):
        place, here = flow_at(i, cells), pressure_at(i, cells)
        behind = flow_at(min(i + 1, cells), cells)
        flow, pressure, drop = x[place], x[here], ahead_pressure - loss - x[here]
        inertia = across_joint(line.joint - (i - 1), line.a3, line.a3_near)
        uneven = ahead_flow - 2.0 * flow + x[behind]
        resistance = line.a4 + (line.a4_inlet if i == 1 else 0.0)
        # friction by the product of old and new flow: with the old flow's alone, half a step late, it would pass for
        # inertance, which is the level of all masses
        slowed = 1.0 / (1.0 + step * resistance * fabs(flow))
        new_flow = slowed * (flow + step * (inertia * drop + line.damping * uneven))
        if t != NULL:
            friction = step * resistance * copysign(1.0, flow)
            keep = slowed * (1.0 - 2.0 * step * line.damping - friction * new_flow)
            push = slowed * step
            _flow_row(
                t, place, -1 if i == 1 else pressure_at(i - 1, cells), here, behind, keep, push * line.damping,
                push * inertia,
            )
            by_line = <WaveLine*> (t.by_coefficient + place * t.size)
            far = across_joint_slopes(line.joint - (i - 1), line.a3, line.a3_near, &near)
            by_line.a3 = push * far * drop
            by_line.a3_near = push * near * drop
            by_line.a4 = -push * fabs(flow) * new_flow
            by_line.damping = push * uneven
        x[place] = new_flow
        ahead_flow, ahead_pressure = flow, pressure
    _stress_end(x, cells, line, t)
    if t != NULL:
        add_coefficients(t, t.by, cells + 2, 2 * cells + 1)
        add_coefficients(t, t.by, 1, 2)
    if line.memory > 0.0:
        drag(x, cells, mean_before, step, line.memory, t)
    for i in range(1, cells):
        place, inflow, outflow = pressure_at(i, cells), flow_at(i, cells), flow_at(i + 1, cells)
        compliance = step * across_joint(line.joint - (i - 0.5), line.b, line.b_near)
        soft, net = stiffness(x[place], &line.softness), x[inflow] - x[outflow]
        if t != NULL:
            by_pressure = stiffness_slopes(x[place], &line.softness, &by_air, &by_slope)
            keep = 1.0 + compliance * by_pressure * net
            _pressure_row(t, place, inflow, outflow, keep, compliance * soft)
            far = across_joint_slopes(line.joint - (i - 0.5), line.b, line.b_near, &near)
            by_line = <WaveLine*> (t.by_coefficient + place * t.size)
            by_line.b = step * soft * far * net
            by_line.b_near = step * soft * near * net
            by_line.softness.air = compliance * by_air * net
            by_line.softness.stiffness_slope = compliance * by_slope * net
        x[place] += compliance * soft * net
    if t != NULL:
        add_coefficients(t, t.by, 3, cells + 2)


cdef void _stress_end(double* x, int64_t cells, const WaveLine* line, Tangent* t) noexcept nogil:
    """Apply the end cell's compression in the step before to the flow into it."""
    cdef int64_t before = before_at(cells), j
    cdef double stress = line.damping / line.b_near, rise = x[0] - x[before]
    cdef double* end
    cdef double* flow
    cdef double* of_before
    if t != NULL:
        end, flow, of_before = t.by, t.by + t.m, t.by + before * t.m
        for j in range(t.m):
            flow[j] -= stress * (end[j] - of_before[j])
            of_before[j] = end[j]
        by_line = <WaveLine*> (t.by_coefficient + t.size)
        by_line.damping -= rise / line.b_near
        by_line.b_near = rise * stress / line.b_near
    x[1] -= stress * rise
    x[before] = x[0]


cdef void _flow_row(
    Tangent* t, int64_t place, int64_t there, int64_t here, int64_t behind, double keep, double even, double push
) noexcept nogil:
    """Move the derivatives of a face's flow; there: place of the pressure ahead, -1 of the rail's."""
    cdef double* ahead = t.moved
    cdef double* nothing = t.moved + t.m
    cdef const double* pressure = nothing if there < 0 else t.by + there * t.m
    cdef double* flow = t.by + place * t.m
    cdef const double* of_here = t.by + here * t.m
    cdef const double* of_behind = t.by + behind * t.m
    cdef double old, drop
    cdef int64_t j
    if there < 0:
        for j in range(t.m):
            ahead[j] = flow[j]
            nothing[j] = 0.0
    for j in range(t.m):
        old = flow[j]
        drop = pressure[j] - of_here[j]
        flow[j] = keep * old + even * (ahead[j] + of_behind[j]) + push * drop
        ahead[j] = old


cdef void _pressure_row(Tangent* t, int64_t place, int64_t inflow, int64_t outflow, double keep, double fill) noexcept nogil:
    """Move the derivatives of a cell's pressure."""
    cdef double* pressure = t.by + place * t.m
    cdef const double* into = t.by + inflow * t.m
    cdef const double* out = t.by + outflow * t.m
    cdef int64_t j
    for j in range(t.m):
        pressure[j] = keep * pressure[j] + fill * (into[j] - out[j])


cdef void add_coefficients(Tangent* t, double* by, int64_t first, int64_t last) noexcept nogil:
    """Add the effects of theta by the line's coefficients to rows first .. last - 1."""
    theta = &t.theta
    cdef int64_t k, row, column, coefficient
    cdef double slope
    for k in range(theta.pairs):
        column, coefficient, slope = theta.columns[k], theta.coefficients[k], theta.slopes[k]
        for row in range(first, last):
            by[row * t.m + column] += t.by_coefficient[row * t.size + coefficient] * slope
