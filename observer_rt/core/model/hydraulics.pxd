# Seat, sac and nozzle, (21)-(23): flows through the areas a lift opens, the orifice law they share, slopes.

from libc.math cimport exp, fabs, pi, sin, sqrt

cdef enum:
    NOZZLE_NUMBERS = 2  # that are learned of the nozzle's law: rise of p_C [p_0] while the needle is open, and for every unit of u_2


cdef struct Seat:
    double transition  # of the orifice law, in units of p_0
    double area_scale  # A_0, m2
    double diameter  # d_S, m
    double half_cone_angle  # rad
    double loss  # a of alpha_S (1 - a exp(-x_N/x_c)), 0 for a constant coefficient
    double loss_lift  # x_c, m
    double density_slope  # how the flow grows with the root of the density in the sac, by x_3
    double density_bend


cdef struct Nozzle:
    double transition  # of the orifice law, in units of p_0
    double flow  # Q_H = flow * root(x_3), m3/s
    double critical_excess  # N_crit - 1, 0 without cavitation
    double vapour_margin  # (p_C - p_v)/p_0
    double chamber_rise  # of p_C while the needle is open, in units of p_0
    double chamber_rise_with_seat  # the same for every unit of u_2
    double jet_slope  # how much slower the jet is for the fuel's density before it, by the pressure difference
    double jet_bend


# Slopes of the nozzle's law; two factors each, for the order in which they are multiplied counts.
cdef struct NozzleSlopes:
    double by_sac
    double[2] by_area
    double[NOZZLE_NUMBERS][2] by_number


cdef struct Sac:
    double a5  # filled through the seat
    double a6  # drained through the nozzle
    double stiffness_slope  # how stiffness grows with x_3
    double stiffness_bend


cdef inline double bent(double distance, double slope, double bend) noexcept nogil:
    """A law of pressure over its value at an origin, by the distance from there: see model.fuel. 1 of constant fuel."""
    return 1.0 + distance * (slope + bend * distance)


cdef inline double bent_slope(double distance, double slope, double bend) noexcept nogil:
    """Derivative of `bent`."""
    return slope + 2.0 * bend * distance


cdef inline double root(double difference, double transition) noexcept nogil:
    """Signed square root of a pressure difference, smooth through zero.

    d / (d^2 + t^2)^(1/4): sgn(d) sqrt|d| for |d| >> t, linear below the transition pressure t, so that the
    orifice laws (21), (23) hold for reversed flow and have a bounded slope 1/sqrt(t).
    """
    return difference / sqrt(sqrt(difference * difference + transition * transition))


cdef inline double root_slope(double difference, double transition) noexcept nogil:
    """Derivative of `root` with respect to the pressure difference."""
    cdef double square = difference * difference
    cdef double sum_of_squares = square + transition * transition
    return (sum_of_squares - 0.5 * square) / (sum_of_squares * sqrt(sqrt(sum_of_squares)))


cdef inline double seat_law(double x_1, double x_3, double u_2, const Seat* seat) noexcept nogil:
    """Normalised seat flow q_S of (21)."""
    return u_2 * root(x_1 - x_3, seat.transition) * bent(x_3, seat.density_slope, seat.density_bend)


cdef inline double seat_law_slopes(
    double x_1, double x_3, double u_2, const Seat* seat, double* by_area, double* by_sac
) noexcept nogil:
    """Derivative of `seat_law` with respect to x_1; by_area: that to u_2, by_sac: that to x_3."""
    cdef double difference = x_1 - x_3, denser = bent(x_3, seat.density_slope, seat.density_bend)
    cdef double through = root(difference, seat.transition)
    cdef double by_line = u_2 * root_slope(difference, seat.transition) * denser
    by_area[0] = through * denser
    by_sac[0] = u_2 * through * bent_slope(x_3, seat.density_slope, seat.density_bend) - by_line
    return by_line


cdef inline double seat_area(double lift, double seat_diameter, double half_cone_angle) noexcept nogil:
    """Flow area of the needle seat A_S(x_N) [m2]; 0 for a closed needle.

    pi x_N sin(b/2) (d_S - x_N/2 sin b), with b/2 the half cone angle [rad]; lift and diameter in m.
    """
    if lift <= 0.0:
        return 0.0
    return pi * lift * sin(half_cone_angle) * (seat_diameter - 0.5 * lift * sin(2.0 * half_cone_angle))


cdef inline double seat_area_slope(double u_2, const Seat* seat) noexcept nogil:
    """Derivative dA_S/dx_N [m] of `seat_area` at the lift that opens u_2 = A_S/A_0; 0 for a closed needle."""
    cdef double whole, square
    if u_2 <= 0.0:
        return 0.0
    whole = pi * sin(seat.half_cone_angle)
    square = seat.diameter * seat.diameter - 2.0 * sin(2.0 * seat.half_cone_angle) * (u_2 * seat.area_scale) / whole
    return whole * sqrt(max(square, 0.0))


cdef inline double normalised_area(double lift, const Seat* seat) noexcept nogil:
    """u_2 = A_S(x_N)/A_0 of a lift [m]; a flow coefficient that depends on the lift is part of it."""
    cdef double area = seat_area(lift, seat.diameter, seat.half_cone_angle) / seat.area_scale
    if seat.loss != 0.0:
        area *= 1.0 - seat.loss * exp(-lift / seat.loss_lift)
    return area


cdef inline double normalised_area_slope(double lift, const Seat* seat) noexcept nogil:
    """Derivative of `normalised_area` [1/m] for an open needle."""
    cdef double whole = pi * sin(seat.half_cone_angle) / seat.area_scale, share, area
    cdef double slope = whole * (seat.diameter - lift * sin(2.0 * seat.half_cone_angle))
    if seat.loss != 0.0:
        share = seat.loss * exp(-lift / seat.loss_lift)
        area = seat_area(lift, seat.diameter, seat.half_cone_angle) / seat.area_scale
        slope = slope * (1.0 - share) + area * share / seat.loss_lift
    return slope


cdef inline double nozzle_law(double x_3, double u_2, const double* learned, const Nozzle* nozzle) noexcept nogil:
    """Normalised nozzle flow q_H of (23), against a chamber pressure that rises while the needle is open (u_2 > 0).

    It rises by the model's numbers and the `learned` ones (NOZZLE_NUMBERS,), in units of p_0. Where the cavitation
    number N = (p_S - p_v)/(p_S - p_C) is below N_crit, the flow coefficient falls by sqrt(N/N_crit): the flow then
    follows sqrt(p_S - p_v) (Nurick 1976, J. Fluids Eng. 98, 681).
    """
    cdef double difference = x_3, margin = nozzle.vapour_margin, flow
    cdef double rise = nozzle.chamber_rise + nozzle.chamber_rise_with_seat * u_2 + (learned[0] + learned[1] * u_2)
    if rise != 0.0 and u_2 > 0.0:
        difference -= rise
        margin += rise
    flow = root(difference, nozzle.transition) * bent(difference, nozzle.jet_slope, nozzle.jet_bend)
    if nozzle.critical_excess != 0.0 and margin < nozzle.critical_excess * difference:
        flow *= sqrt((1.0 + margin / difference) / (1.0 + nozzle.critical_excess))
    return flow


cdef inline NozzleSlopes nozzle_law_slopes(
    double x_3, double u_2, const double* learned, const Nozzle* nozzle
) noexcept nogil:
    """Derivatives of `nozzle_law` with respect to x_3, u_2 and the learned numbers."""
    cdef NozzleSlopes result
    cdef double difference = x_3, margin = nozzle.vapour_margin, rise, slope, critical, loss, flow, by_margin, by_rise
    if u_2 > 0.0:
        rise = nozzle.chamber_rise + nozzle.chamber_rise_with_seat * u_2 + (learned[0] + learned[1] * u_2)
        difference -= rise
        margin += rise
    slope = root_slope(difference, nozzle.transition)
    if nozzle.jet_slope != 0.0:
        slope *= bent(difference, nozzle.jet_slope, nozzle.jet_bend)
        slope += root(difference, nozzle.transition) * bent_slope(difference, nozzle.jet_slope, nozzle.jet_bend)
    by_rise = -slope
    if nozzle.critical_excess != 0.0 and margin < nozzle.critical_excess * difference:
        critical = 1.0 + nozzle.critical_excess
        loss = sqrt((1.0 + margin / difference) / critical)
        flow = root(difference, nozzle.transition) * bent(difference, nozzle.jet_slope, nozzle.jet_bend)
        by_margin = flow / (2.0 * critical * loss * difference)
        slope = slope * loss - by_margin * margin / difference
        by_rise = by_margin - slope
    if u_2 <= 0.0:
        by_rise = 0.0
    result.by_sac = slope
    result.by_area[0], result.by_area[1] = by_rise, nozzle.chamber_rise_with_seat + learned[1]
    result.by_number[0][0], result.by_number[0][1] = by_rise, 1.0
    result.by_number[1][0], result.by_number[1][1] = by_rise, u_2
    return result


cdef inline double sac_rate(double q_h, double q_s, const Sac* sac) noexcept nogil:
    """p_S' of (22) at the pressure of the chamber, normalised [1/s]; elsewhere `sac_stiffness` times it."""
    return sac.a5 * q_s - sac.a6 * q_h


cdef inline double sac_stiffness(double x_3, const Sac* sac) noexcept nogil:
    """Stiffness of the sac over that at the pressure of the chamber."""
    return bent(x_3, sac.stiffness_slope, sac.stiffness_bend)
