/* The line as one lump, (19)-(20), by classical Runge-Kutta steps. */
#include "model.h"

#define LINE_STEP R(0.1) /* radians of the line's motion in a step while nothing flows */

void inj_line_at_rest(real_t x[], real_t pressure)
{
    x[P_LINE] = pressure;
    x[Q_LINE] = R(0.0);
}

void inj_change_waves(Line *line, real_t stiffer, real_t lighter)
{
    (void)line;
    (void)stiffer;
    (void)lighter;
}

/* x' = f(x, u) + phi(x, u) of (25)-(26) [1/s]. */
static void rates(const real_t x[], Inputs u, const Model *m, real_t rate[STATES])
{
    const Line *line = &m->line;
    real_t q_h = R(0.0);
    real_t q_s = R(0.0);
    if (!inj_is_at_rest(x, u)) {
        inj_flows(x, u, m, &q_h, &q_s);
    }
    rate[P_LINE] = inj_softened(x[P_LINE], line) *
                   (line->a1 * (x[Q_LINE] - line->outflow) - line->a2_nozzle * q_h - line->a2_seat * q_s -
                    line->leak * x[P_LINE]);
    rate[Q_LINE] =
        line->a3 * (u.rail - line->loss - x[P_LINE]) - line->a4 * x[Q_LINE] * r_fabs(x[Q_LINE]);
    rate[P_SAC] = SAC_A5 * q_s - SAC_A6 * q_h;
}

void inj_line_under_laws(const real_t x[], Inputs u, const Model *m, real_t *pressure, real_t *flow)
{
    const real_t half = R(0.5) * SAMPLE_INTERVAL;
    real_t rate[STATES];
    rates(x, u, m, rate);
    *pressure = x[P_LINE] + half * rate[P_LINE];
    *flow = x[Q_LINE] + half * rate[Q_LINE];
}

static Inputs between(const Interval *interval, real_t share)
{
    Inputs u;
    u.rail = interval->start.rail + share * (interval->end.rail - interval->start.rail);
    u.area = r_max(interval->start.area + share * (interval->end.area - interval->start.area), R(0.0));
    return u;
}

static void step_on(real_t x[], Inputs start, Inputs middle, Inputs end, real_t step, const Model *m)
{
    real_t first[STATES];
    real_t second[STATES];
    real_t third[STATES];
    real_t fourth[STATES];
    real_t there[STATES];
    const real_t half = R(0.5) * step;
    rates(x, start, m, first);
    for (uint32_t i = 0U; i < STATES; ++i) {
        there[i] = x[i] + half * first[i];
    }
    rates(there, middle, m, second);
    for (uint32_t i = 0U; i < STATES; ++i) {
        there[i] = x[i] + half * second[i];
    }
    rates(there, middle, m, third);
    for (uint32_t i = 0U; i < STATES; ++i) {
        there[i] = x[i] + step * third[i];
    }
    rates(there, end, m, fourth);
    for (uint32_t i = 0U; i < STATES; ++i) {
        x[i] = x[i] + step / R(6.0) * ((first[i] + R(2.0) * (second[i] + third[i])) + fourth[i]);
    }
}

void inj_advance(real_t x[], const Interval *interval, const Model *m)
{
    uint32_t steps = SUBSTEPS;
    if (inj_is_at_rest(x, interval->start) && (interval->end.area <= R(0.0))) {
        const real_t fastest = r_sqrt(m->line.a1 * m->line.a3);
        const real_t fewer = r_ceil(SAMPLE_INTERVAL * fastest / LINE_STEP);
        if (fewer < (real_t)SUBSTEPS) {
            steps = (uint32_t)fewer;
        }
    }
    const real_t count = (real_t)steps;
    for (uint32_t i = 0U; i < steps; ++i) {
        const real_t at = (real_t)i;
        step_on(x, between(interval, at / count), between(interval, (at + R(0.5)) / count),
                between(interval, (at + R(1.0)) / count), SAMPLE_INTERVAL / count, m);
    }
    inj_empty_if_drained(x, interval);
}
