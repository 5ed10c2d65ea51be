/* Laws in force: variables of them, in printed units, and what they change. */
#include "forcing.h"

#define MEGAPASCAL R(1e6)
#define MILLIMETRE R(1e-3)
#define MM3_PER_MS R(1e-6)
#define LEAST_LIFT R(0.02e-6) /* m, from which on a law holds a needle open that is seen to be shut */
#define INTERVAL_MS (SAMPLE_INTERVAL / R(1e-3))

void inj_forcing_init(Forcing *f)
{
    inj_laws_init(&f->memory);
    for (uint32_t i = 0U; i < LAW_VARIABLES; ++i) {
        f->variables[i] = R(0.0);
    }
    f->samples = 0U;
    f->injections = R(0.0);
    f->since_opening = R(0.0);
    f->lift_before = R(0.0);
    f->pressure_before = (real_t)NAN;
    f->area = R(0.0);
    f->line = INJ_MODEL.line;
}

static void observe(const real_t x[], const Interval *interval, Forcing *f)
{
    real_t *v = f->variables;
    const real_t unit = PRESSURE_SCALE / MEGAPASCAL;
    const real_t chamber = CHAMBER_PRESSURE / MEGAPASCAL;
    const real_t through_nozzle = NOZZLE_FLOW / MM3_PER_MS;
    real_t q_h = R(0.0);
    real_t q_s = R(0.0);
    Inputs u;
    u.rail = R(0.5) * (interval->start.rail + interval->end.rail);
    u.area = R(0.5) * (r_max(interval->start.area, R(0.0)) + r_max(interval->end.area, R(0.0)));
    const bool is_open = u.area > R(0.0);
    const real_t lift = inj_lift_of(u.area) / MILLIMETRE;
    real_t line_pressure;
    real_t line_flow;
    Model before = INJ_MODEL;
    before.line = f->line;
    inj_line_under_laws(x, u, &before, &line_pressure, &line_flow);
    const real_t pressure = line_pressure * unit + chamber;
    const real_t rise = pressure - f->pressure_before;
    if (is_open && (f->lift_before <= R(0.0))) {
        f->injections += R(1.0);
        f->since_opening = R(0.0);
    }
    if ((LAWS_READ_FLOWS != 0) && !inj_is_at_rest(x, u)) {
        inj_flows(x, u, &INJ_MODEL, &q_h, &q_s);
    }
    v[LAW_RAIL_PRESSURE] = u.rail * unit + chamber;
    v[LAW_LINE_PRESSURE] = pressure;
    v[LAW_SAC_PRESSURE] = x[P_SAC] * unit + chamber;
    v[LAW_CHAMBER_PRESSURE] = chamber;
    v[LAW_LINE_FLOW] = line_flow * FLOW_SCALE / MM3_PER_MS;
    v[LAW_SEAT_FLOW] = q_s * through_nozzle * SAC_A5 / SAC_A6;
    v[LAW_NOZZLE_FLOW] = q_h * through_nozzle;
    v[LAW_NEEDLE_LIFT] = lift;
    v[LAW_LIFT_RATE] = (lift - f->lift_before) / INTERVAL_MS;
    v[LAW_RAIL_PRESSURE_RATE] = (interval->end.rail - interval->start.rail) * unit / INTERVAL_MS;
    v[LAW_LINE_PRESSURE_RATE] = isnan(rise) ? R(0.0) : (rise / INTERVAL_MS);
    v[LAW_TIME_SINCE_OPENING] = f->since_opening;
    v[LAW_TIME] = (real_t)f->samples * SAMPLE_INTERVAL;
    v[LAW_INJECTION_NUMBER] = r_max(f->injections, R(1.0));
    v[LAW_OPEN] = is_open ? R(1.0) : R(0.0);
    v[LAW_CLOSED] = is_open ? R(0.0) : R(1.0);
    v[LAW_OPENING] = (is_open && (v[LAW_LIFT_RATE] > R(0.0))) ? R(1.0) : R(0.0);
    v[LAW_CLOSING] = (is_open && (v[LAW_LIFT_RATE] < R(0.0))) ? R(1.0) : R(0.0);
    f->lift_before = lift;
    f->pressure_before = pressure;
    f->since_opening += INTERVAL_MS;
    f->samples += 1U;
}

/* A seat area with so much lift [m] added; a needle seen to be shut may stay so, or be held open. */
static real_t lifted(real_t area, real_t lift, bool moves)
{
    real_t found = area;
    if (lift != R(0.0)) {
        const real_t measured = inj_lift_of(r_fabs(area));
        real_t total = lift;
        if (area > R(0.0)) {
            total += measured;
        } else if (moves) {
            total -= measured;
        } else {
            /* at rest on its seat */
        }
        if ((area > R(0.0)) || (total >= LEAST_LIFT)) {
            found = inj_seat_opened(total);
        }
    }
    return found;
}

void inj_under_laws(const real_t x[], const Interval *interval, Forcing *f, Forced *forced)
{
    const real_t pressure = MEGAPASCAL / PRESSURE_SCALE;
    real_t totals[LAW_EQUATIONS];
    forced->interval = *interval;
    forced->model = INJ_MODEL;
    if (HAS_LAWS != 0) {
        observe(x, interval, f);
        inj_laws_of_model(f->variables, &f->memory, INTERVAL_MS, totals);
        const real_t lift = totals[LAW_OF_NEEDLE_LIFT] * MILLIMETRE;
        const real_t more = totals[LAW_OF_RAIL_PRESSURE] * pressure;
        const bool moves = f->variables[LAW_OPEN] > R(0.0);
        forced->model.bias[0] += totals[LAW_OF_NOZZLE_FLOW];
        forced->model.bias[1] += totals[LAW_OF_SEAT_FLOW];
        forced->model.nozzle[0] += totals[LAW_OF_CHAMBER_PRESSURE] * pressure;
        inj_change_line(&forced->model.line, totals[LAW_OF_STIFFNESS], totals[LAW_OF_INERTANCE],
                    totals[LAW_OF_LINE_PRESSURE] * (MM3_PER_MS / FLOW_SCALE),
                    totals[LAW_OF_LINE_FLOW] * pressure);
        f->line = forced->model.line;
        forced->interval.start.rail += more;
        forced->interval.end.rail += more;
        forced->interval.start.area = lifted(interval->start.area, lift, moves);
        forced->interval.end.area = lifted(interval->end.area, lift, moves);
        f->area = forced->interval.end.area;
    }
}

real_t inj_shown_under_laws(real_t shown, Forcing *f)
{
    real_t found = shown;
    if (HAS_SENSOR_LAWS != 0) {
        real_t totals[LAW_EQUATIONS];
        const real_t pressure = (shown * PRESSURE_SCALE + CHAMBER_PRESSURE) / MEGAPASCAL;
        f->variables[LAW_LINE_PRESSURE] = pressure;
        f->variables[LAW_LINE_PRESSURE_RATE] = (pressure - f->pressure_before) / INTERVAL_MS;
        inj_laws_of_sensor(f->variables, &f->memory, INTERVAL_MS, totals);
        found += totals[LAW_OF_LINE_PRESSURE_SENSOR] * MEGAPASCAL / PRESSURE_SCALE;
    }
    return found;
}

bool inj_is_shut_under_laws(const Forcing *f)
{
    return f->area <= R(0.0);
}

real_t inj_trusted_under_laws(real_t innovation, Forcing *f)
{
    return (HAS_SENSOR_LAWS != 0) ? inj_laws_without_ringing(&f->memory, innovation, INTERVAL_MS) : innovation;
}
