/* Laws of seat, sac and nozzle, (21)-(23), and what was learned of their flows. */
#include "model.h"

#define EMPTY_SAC R(1e-7)        /* of p_0: a shut, drained sac this close to chamber pressure is at it */
#define LOWEST_PRESSURE R(0.01)  /* of p_0, at which entrained air softens the line no further */
#define LOWEST_STIFFNESS R(0.05) /* of K_L */
#define LIFT_ITERATIONS 5

const Model INJ_MODEL = {LINE_VALUES, LEARNED_BIAS, LEARNED_NOZZLE};

static real_t root(real_t difference)
{
    const real_t squares = difference * difference + ORIFICE_TRANSITION * ORIFICE_TRANSITION;
    return difference / r_sqrt(r_sqrt(squares));
}

static real_t root_slope(real_t difference)
{
    const real_t square = difference * difference;
    const real_t squares = square + ORIFICE_TRANSITION * ORIFICE_TRANSITION;
    return (squares - R(0.5) * square) / (squares * r_sqrt(r_sqrt(squares)));
}

/* tanh to within 1e-12: Lambert's continued fraction at a quarter of the argument, doubled twice. */
static real_t fast_tanh(real_t argument)
{
    const real_t quarter = R(0.25) * r_min(r_max(argument, R(-20.0)), R(20.0));
    const real_t square = quarter * quarter;
    const real_t a = quarter * (R(135135.0) + square * (R(17325.0) + square * (R(378.0) + square)));
    const real_t b = R(135135.0) + square * (R(62370.0) + square * (R(3150.0) + square * R(28.0)));
    const real_t p = R(2.0) * a * b;
    const real_t q = a * a + b * b;
    return R(2.0) * p * q / (p * p + q * q);
}

real_t inj_seat_opened(real_t lift)
{
    real_t area = R(0.0);
    if (lift > R(0.0)) {
        area = REAL_PI * lift * r_sin(SEAT_HALF_CONE_ANGLE);
        area *= SEAT_DIAMETER - R(0.5) * lift * r_sin(R(2.0) * SEAT_HALF_CONE_ANGLE);
        area /= AREA_SCALE;
        area *= R(1.0) - SEAT_LOSS * r_exp(-lift / SEAT_LOSS_LIFT);
    }
    return area;
}

static real_t lift_of_area(real_t area)
{
    const real_t bend = r_sin(R(2.0) * SEAT_HALF_CONE_ANGLE);
    const real_t scaled = area / (REAL_PI * r_sin(SEAT_HALF_CONE_ANGLE));
    const real_t square = SEAT_DIAMETER * SEAT_DIAMETER - R(2.0) * bend * scaled;
    return R(2.0) * scaled / (SEAT_DIAMETER + r_sqrt(r_max(square, R(0.0))));
}

real_t inj_lift_of(real_t area)
{
    real_t lift = R(0.0);
    if (area > R(0.0)) {
        lift = lift_of_area(area * AREA_SCALE);
        for (uint32_t i = 0U; i < LIFT_ITERATIONS; ++i) {
            lift = lift_of_area(area * AREA_SCALE / (R(1.0) - SEAT_LOSS * r_exp(-lift / SEAT_LOSS_LIFT)));
        }
    }
    return lift;
}

bool inj_is_at_rest(const real_t x[], Inputs u)
{
    return (u.area <= R(0.0)) && (x[P_SAC] == R(0.0));
}

real_t inj_seat_law(real_t difference, real_t area)
{
    return area * root(difference);
}

real_t inj_seat_slope(real_t difference, real_t area)
{
    return area * root_slope(difference);
}

/* p_S - p_C and (p_C - p_v) with the rise of p_C while the needle is open. */
static real_t over_chamber(real_t p_sac, real_t area, const real_t learned[2], real_t *margin)
{
    const real_t rise = CHAMBER_RISE + CHAMBER_RISE_WITH_SEAT * area + (learned[0] + learned[1] * area);
    real_t difference = p_sac;
    *margin = VAPOUR_MARGIN;
    if (area > R(0.0)) {
        difference -= rise;
        *margin += rise;
    }
    return difference;
}

static bool cavitates(real_t difference, real_t margin)
{
    return (CRITICAL_EXCESS != R(0.0)) && (margin < CRITICAL_EXCESS * difference);
}

real_t inj_nozzle_law(real_t p_sac, real_t area, const real_t learned[2])
{
    real_t margin;
    const real_t difference = over_chamber(p_sac, area, learned, &margin);
    real_t flow = root(difference);
    if (cavitates(difference, margin)) {
        flow *= r_sqrt((R(1.0) + margin / difference) / (R(1.0) + CRITICAL_EXCESS));
    }
    return flow;
}

real_t inj_nozzle_slope(real_t p_sac, real_t area, const real_t learned[2])
{
    real_t margin;
    const real_t difference = over_chamber(p_sac, area, learned, &margin);
    real_t slope = root_slope(difference);
    if (cavitates(difference, margin)) {
        const real_t critical = R(1.0) + CRITICAL_EXCESS;
        const real_t loss = r_sqrt((R(1.0) + margin / difference) / critical);
        const real_t by_margin = root(difference) / (R(2.0) * critical * loss * difference);
        slope = slope * loss - by_margin * margin / difference;
    }
    return slope;
}

real_t inj_neuron(const real_t x[], Inputs u, uint32_t number)
{
    const real_t *row = INJ_HIDDEN_LAYER[number];
    return fast_tanh(row[0] * x[0] + row[1] * x[1] + row[2] * x[2] + row[3] * u.rail + row[4] * u.area + row[5]);
}

void inj_flows(const real_t x[], Inputs u, const Model *m, real_t *q_h, real_t *q_s)
{
    real_t nozzle_change = m->bias[0];
    real_t seat_change = m->bias[1];
    for (uint32_t i = 0U; i < NEURONS; ++i) {
        const real_t sigma = inj_neuron(x, u, i);
        nozzle_change += INJ_OUTPUT_LAYER[0][i] * sigma;
        seat_change += INJ_OUTPUT_LAYER[1][i] * sigma;
    }
    *q_h = inj_nozzle_law(x[P_SAC], u.area, m->nozzle) * (R(1.0) + nozzle_change);
    *q_s = inj_seat_law(x[P_LINE] - x[P_SAC], u.area) * (R(1.0) + seat_change);
}

real_t inj_injection_rate(const real_t x[], Inputs u, const Model *m)
{
    real_t q_h = R(0.0);
    real_t q_s = R(0.0);
    if (!inj_is_at_rest(x, u)) {
        inj_flows(x, u, m, &q_h, &q_s);
    }
    return NOZZLE_FLOW * q_h;
}

real_t inj_softened(real_t pressure, const Line *line)
{
    real_t fuel = R(1.0) + line->stiffness_slope * (pressure - line->stiffness_pressure);
    fuel = r_max(fuel, LOWEST_STIFFNESS);
    if (line->air != R(0.0)) {
        const real_t absolute = r_max(pressure + line->chamber_pressure, LOWEST_PRESSURE);
        fuel = fuel * (absolute / (absolute + fuel * line->air));
    }
    return fuel;
}

void inj_change_line(Line *line, real_t stiffness, real_t inertance, real_t outflow, real_t loss)
{
    const real_t stiffer = R(1.0) + stiffness;
    const real_t lighter = R(1.0) + (R(1.0) / (R(1.0) + inertance) - R(1.0));
    line->a1 *= stiffer;
    line->a2_nozzle *= stiffer;
    line->a2_seat *= stiffer;
    line->leak *= stiffer;
    line->a3 *= lighter;
    line->a4 *= lighter;
    line->outflow = outflow;
    line->loss = loss;
    inj_change_waves(line, stiffer, lighter);
}

void inj_empty_if_drained(real_t x[], const Interval *interval)
{
    const bool is_shut = (interval->start.area <= R(0.0)) && (interval->end.area <= R(0.0));
    if (is_shut && (r_fabs(x[P_SAC]) < EMPTY_SAC)) {
        x[P_SAC] = R(0.0);
    }
}
