/* The line as a pipe in which pressure travels: cells between faces, staggered, by leapfrog; end and sac implicitly.
 *
 * x = [p_n, q_n, p_S, p_1 .. p_(n-1), q_1 .. q_(n-1), p_n a step before, w_1 .. w_3: what is remembered of the flow].
 */
#include "model.h"

#define MEMORIES 3U
#define MOST_ITERATIONS 40U
#define SPARE R(0.1) /* of p_0, by which p_S may leave the range of the pressures round it */
#if OBSERVER_SINGLE
#define CLOSE R(1e-6)
#else
#define CLOSE R(1e-9) /* of p_0: pressures this close solve the step at the closed end */
#endif
#define STRESS_BEFORE (2U * CELLS + 1U) /* place in x of p_n a step before */

static const real_t FORGETTING[MEMORIES] = {R(296.0), R(4861.0), R(44730.0)};
static const real_t WEIGHTS[MEMORIES] = {R(46.75), R(100.8), R(297.2)};

static uint32_t pressure_at(uint32_t cell) { return (cell == CELLS) ? 0U : (2U + cell); }
static uint32_t flow_at(uint32_t face) { return (face == CELLS) ? 1U : (1U + CELLS + face); }
static uint32_t memory_at(uint32_t number) { return 2U * CELLS + 2U + number; }

void inj_line_at_rest(real_t x[], real_t pressure)
{
    for (uint32_t i = 1U; i <= CELLS; ++i) {
        x[pressure_at(i)] = pressure;
        x[flow_at(i)] = R(0.0);
    }
    x[STRESS_BEFORE] = pressure;
    for (uint32_t k = 0U; k < MEMORIES; ++k) {
        x[memory_at(k)] = R(0.0);
    }
}

void inj_change_waves(Line *line, real_t stiffer, real_t lighter)
{
    line->b *= stiffer;
    line->b_near *= stiffer;
    line->a3_near *= lighter;
    line->a4_inlet *= lighter;
}

/* Inertia of a face or compliance of a cell, of which a share is on the rail's side of the joint of two parts. */
static real_t across_joint(real_t share, real_t far, real_t near)
{
    real_t value = near;
    if (share >= R(1.0)) {
        value = far;
    } else if (share > R(0.0)) {
        value = R(1.0) / (share / far + (R(1.0) - share) / near);
    }
    return value;
}

static real_t mean_flow(const real_t x[])
{
    real_t total = R(0.0);
    for (uint32_t i = 1U; i <= CELLS; ++i) {
        total += x[flow_at(i)];
    }
    return total / (real_t)CELLS;
}

void inj_line_under_laws(const real_t x[], Inputs u, const Model *m, real_t *pressure, real_t *flow)
{
    (void)u;
    (void)m;
    *pressure = x[P_LINE];
    *flow = mean_flow(x);
}

/* Friction that remembers, on all flows in a step, and what it remembers. */
static void drag(real_t x[], real_t mean_before, real_t step, real_t memory)
{
    const real_t change = mean_flow(x) - mean_before;
    real_t pull = R(0.0);
    real_t by_change = R(0.0);
    real_t take[MEMORIES];
    real_t keep[MEMORIES];
    for (uint32_t k = 0U; k < MEMORIES; ++k) {
        const real_t fade = R(0.5) * step * FORGETTING[k];
        const real_t half = R(0.5) * memory * WEIGHTS[k];
        take[k] = R(1.0) / (R(1.0) + fade);
        keep[k] = (R(1.0) - fade) / (R(1.0) + fade);
        pull += half * (R(1.0) + keep[k]) * x[memory_at(k)];
        by_change += half * take[k];
    }
    const real_t push = step / (R(1.0) + step * by_change);
    const real_t shift = -push * (pull + by_change * change);
    for (uint32_t i = 1U; i <= CELLS; ++i) {
        x[flow_at(i)] += shift;
    }
    for (uint32_t k = 0U; k < MEMORIES; ++k) {
        x[memory_at(k)] = keep[k] * x[memory_at(k)] + take[k] * (change + shift);
    }
}

/* All flows a step on, then all pressures but that of the end cell. */
static void move_line(real_t x[], real_t rail, real_t step, const Line *line)
{
    const real_t mean_before = (line->memory > R(0.0)) ? mean_flow(x) : R(0.0);
    const real_t loss = line->loss / (real_t)CELLS;
    real_t ahead_flow = x[flow_at(1U)];
    real_t ahead_pressure = rail;
    for (uint32_t i = 1U; i <= CELLS; ++i) {
        const uint32_t place = flow_at(i);
        const real_t behind = x[flow_at((i < CELLS) ? (i + 1U) : CELLS)];
        const real_t flow = x[place];
        const real_t pressure = x[pressure_at(i)];
        const real_t drop = ahead_pressure - loss - pressure;
        const real_t inertia = across_joint(line->joint - (real_t)(i - 1U), line->a3, line->a3_near);
        const real_t uneven = ahead_flow - R(2.0) * flow + behind;
        const real_t resistance = line->a4 + ((i == 1U) ? line->a4_inlet : R(0.0));
        const real_t slowed = R(1.0) / (R(1.0) + step * resistance * r_fabs(flow));
        x[place] = slowed * (flow + step * (inertia * drop + line->damping * uneven));
        ahead_flow = flow;
        ahead_pressure = pressure;
    }
    x[Q_LINE] -= line->damping / line->b_near * (x[P_LINE] - x[STRESS_BEFORE]);
    x[STRESS_BEFORE] = x[P_LINE];
    if (line->memory > R(0.0)) {
        drag(x, mean_before, step, line->memory);
    }
    for (uint32_t i = 1U; i < CELLS; ++i) {
        const uint32_t place = pressure_at(i);
        const real_t share = line->joint - ((real_t)i - R(0.5));
        const real_t compliance = step * across_joint(share, line->b, line->b_near);
        x[place] += compliance * inj_softened(x[place], line) * (x[flow_at(i)] - x[flow_at(i + 1U)]);
    }
}

/* p_L (returned) and p_S after implicit steps [s] at the inputs u, by Newton's method; line_step 0 leaves p_L. */
static real_t solve_end(const real_t x[], Inputs u, real_t sac_step, real_t line_step, const Model *m, real_t *sac)
{
    const Line *line = &m->line;
    const real_t inflow = line->a1 * (x[Q_LINE] - line->outflow);
    const real_t lowest = r_min(r_min(x[P_SAC], x[P_LINE]), R(0.0)) - SPARE;
    const real_t highest = r_max(r_max(x[P_SAC], x[P_LINE]), R(0.0)) + SPARE;
    real_t state[3] = {x[P_LINE], x[Q_LINE], x[P_SAC]};
    bool is_close = false;
    for (uint32_t k = 0U; (k < MOST_ITERATIONS) && !is_close; ++k) {
        const real_t p = state[P_LINE];
        const real_t s = state[P_SAC];
        real_t nozzle_change = m->bias[0];
        real_t seat_change = m->bias[1];
        real_t by_sac_h = R(0.0);
        real_t by_sac_s = R(0.0);
        for (uint32_t i = 0U; i < NEURONS; ++i) {
            const real_t sigma = inj_neuron(state, u, i);
            const real_t bend = (R(1.0) - sigma * sigma) * INJ_HIDDEN_LAYER[i][2];
            nozzle_change += INJ_OUTPUT_LAYER[0][i] * sigma;
            seat_change += INJ_OUTPUT_LAYER[1][i] * sigma;
            by_sac_h += INJ_OUTPUT_LAYER[0][i] * bend;
            by_sac_s += INJ_OUTPUT_LAYER[1][i] * bend;
        }
        const real_t through_nozzle = inj_nozzle_law(s, u.area, m->nozzle);
        const real_t through_seat = inj_seat_law(p - s, u.area);
        const real_t q_h = through_nozzle * (R(1.0) + nozzle_change);
        const real_t q_s = through_seat * (R(1.0) + seat_change);
        const real_t h_s =
            inj_nozzle_slope(s, u.area, m->nozzle) * (R(1.0) + nozzle_change) + through_nozzle * by_sac_h;
        const real_t s_p = inj_seat_slope(p - s, u.area) * (R(1.0) + seat_change);
        const real_t s_s = through_seat * by_sac_s - s_p;
        const real_t line_error =
            p - x[P_LINE] -
            line_step * (inflow - line->leak * p - line->a2_nozzle * q_h - line->a2_seat * q_s);
        const real_t sac_error = s - x[P_SAC] - sac_step * (SAC_A5 * q_s - SAC_A6 * q_h);
        const real_t pp = R(1.0) + line_step * (line->leak + line->a2_seat * s_p);
        const real_t ps = line_step * (line->a2_nozzle * h_s + line->a2_seat * s_s);
        const real_t sp = -sac_step * SAC_A5 * s_p;
        const real_t ss = R(1.0) + sac_step * (SAC_A6 * h_s - SAC_A5 * s_s);
        const real_t whole = pp * ss - ps * sp;
        const real_t by_p = (ps * sac_error - ss * line_error) / whole;
        real_t by_s = (sp * line_error - pp * sac_error) / whole;
        if (s + by_s < lowest) {
            by_s = R(0.5) * (lowest - s);
        } else if (s + by_s > highest) {
            by_s = R(0.5) * (highest - s);
        } else {
            /* within its range */
        }
        state[P_LINE] = p + by_p;
        state[P_SAC] = s + by_s;
        is_close = (r_fabs(by_p) + r_fabs(by_s)) < CLOSE;
    }
    *sac = state[P_SAC];
    return state[P_LINE];
}

/* The end cell's pressure and p_S a step on; mean, end: inputs over the step and at its end. */
static void move_end(real_t x[], Inputs mean, Inputs end, real_t step, const Model *m)
{
    const Line *line = &m->line;
    const real_t half = R(0.5) * step;
    const real_t before = x[P_LINE];
    const real_t soft = inj_softened(before, line);
    real_t sac = R(0.0);
    real_t middle;
    if (inj_is_at_rest(x, mean) && (end.area <= R(0.0))) {
        middle = (before + half * soft * line->a1 * (x[Q_LINE] - line->outflow)) /
                 (R(1.0) + half * soft * line->leak);
    } else {
        middle = solve_end(x, mean, half, half * soft, m, &sac);
    }
    x[P_SAC] = sac;
    x[P_LINE] = R(2.0) * middle - before;
    if (!inj_is_at_rest(x, end)) {
        (void)solve_end(x, end, half, R(0.0), m, &sac);
        x[P_SAC] = sac;
    }
}

/* Mean of the open seat's area over a part of an interval, shares first to last, and the area at its end. */
static real_t open_area(const Interval *interval, real_t first, real_t last, real_t *at_end)
{
    const real_t start = interval->start.area;
    const real_t end = interval->end.area;
    real_t mean = R(0.0);
    *at_end = R(0.0);
    if ((start > R(0.0)) || (end > R(0.0))) {
        const real_t a = start + first * (end - start);
        const real_t b = start + last * (end - start);
        *at_end = r_max(b, R(0.0));
        if ((a >= R(0.0)) && (b >= R(0.0))) {
            mean = R(0.5) * (a + b);
        } else if ((a > R(0.0)) || (b > R(0.0))) {
            const real_t highest = r_max(a, b);
            mean = R(0.5) * highest * highest / r_fabs(b - a);
        } else {
            /* shut all through the part */
        }
    }
    return mean;
}

void inj_advance(real_t x[], const Interval *interval, const Model *m)
{
    const real_t step = SAMPLE_INTERVAL / (real_t)LINE_STEPS;
    const real_t part = R(1.0) / (real_t)(LINE_STEPS * END_STEPS);
    const real_t rise = interval->end.rail - interval->start.rail;
    for (uint32_t i = 0U; i < LINE_STEPS; ++i) {
        const real_t share = (real_t)i / (real_t)LINE_STEPS;
        Inputs mean = {interval->start.rail + share * rise, R(0.0)};
        Inputs last = mean;
        move_line(x, mean.rail, step, &m->line);
        for (uint32_t j = 0U; j < END_STEPS; ++j) {
            const real_t first = share + (real_t)j * part;
            mean.area = open_area(interval, first, first + part, &last.area);
            move_end(x, mean, last, step / (real_t)END_STEPS, m);
        }
    }
    inj_empty_if_drained(x, interval);
}
