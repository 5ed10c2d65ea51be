/* Observer of an injector: x~ is predicted and corrected by its innovation, x^ runs open loop while the needle is open. */
#include "observer.h"

#include "sensor.h"

#define LEAP_SQUARED R(100.0)      /* of an innovation from one sample to the next, ten standard deviations */
#define OFFSET_FOLLOWS R(5e-3)     /* s of standstill in which the offset of x~ follows its innovations */
#define FURTHEST_OFFSET R(1.5e6)   /* Pa, from the learned one */
#define CALM_SQUARED R(0.49e12)    /* Pa2, of a line pressure in which no injection rings */

static uint32_t one_more(uint32_t count)
{
    return (count < LONG_AGO) ? (count + 1U) : count;
}

static real_t normalised(real_t pressure)
{
    return (pressure - CHAMBER_PRESSURE) / PRESSURE_SCALE;
}

static InjectorState in_si(const real_t x[])
{
    InjectorState found;
    found.line_pressure = x[P_LINE] * PRESSURE_SCALE + CHAMBER_PRESSURE;
    found.line_flow = x[Q_LINE] * FLOW_SCALE;
    found.sac_pressure = x[P_SAC] * PRESSURE_SCALE + CHAMBER_PRESSURE;
    return found;
}

static void copy_state(const real_t from[], real_t to[])
{
    for (uint32_t i = 0U; i < STATES; ++i) {
        to[i] = from[i];
    }
}

void inj_observer_init(Observer *o)
{
    inj_front_end_init(&o->front_end);
    inj_forcing_init(&o->of_tilde);
    inj_forcing_init(&o->of_hat);
    for (uint32_t i = 0U; i < LIFT_RING; ++i) {
        o->rail[i] = R(0.0);
        o->line[i] = R(0.0);
    }
    for (uint32_t i = 0U; i < STATES; ++i) {
        o->x_tilde[i] = R(0.0);
        o->x_hat[i] = R(0.0);
    }
    o->lift_zero = LIFT_ZERO;
    o->received = 0U;
    o->known = 0U;
    o->since_start = 0U;
    o->closed_since_start = 0U;
    o->since_rest = 0U;
    o->is_synchronised = false;
    o->leaping = 0U;
    o->accepted_innovation = R(0.0);
    o->offset = SENSOR_OFFSET;
    o->first_line = R(0.0);
    o->lines = R(0.0);
    o->line_squares = R(0.0);
    o->indicated = R(0.0);
    o->before.rail = R(0.0);
    o->before.area = R(0.0);
}

/* x~ and x^ anew: p_L as recorded, no flow, an empty sac. */
static void start(Observer *o, real_t line_pressure)
{
    o->offset = SENSOR_OFFSET;
    o->indicated = line_pressure - o->offset;
    o->accepted_innovation = R(0.0);
    inj_line_at_rest(o->x_tilde, o->indicated);
    o->x_tilde[P_SAC] = R(0.0);
    copy_state(o->x_tilde, o->x_hat);
    inj_laws_init(&o->of_tilde.memory);
    o->of_tilde.line = INJ_MODEL.line;
    o->since_start = 0U;
    o->closed_since_start = 0U;
}

/* Whether an innovation may correct x~: not where it leaps, for some samples at most. */
static bool is_accepted(Observer *o, real_t innovation)
{
    const real_t leap = innovation - o->accepted_innovation;
    const real_t square = leap * leap * INNOVATION_WEIGHT;
    const bool is_leap = isfinite(square) && (square > LEAP_SQUARED);
    if (is_leap && o->is_synchronised && (o->leaping < MOST_LEAPING)) {
        o->leaping += 1U;
    } else {
        o->accepted_innovation = innovation;
        o->leaping = 0U;
    }
    return o->leaping == 0U;
}

/* x~ from the sample before, and its innovation, 0 where there is none. */
static real_t predict(Observer *o, const Interval *interval, uint32_t number)
{
    const real_t before = o->x_tilde[P_LINE];
    const real_t indicated_before = o->indicated;
    real_t innovation = R(0.0);
    Forced forced;
    inj_under_laws(o->x_tilde, interval, &o->of_tilde, &forced);
    inj_advance(o->x_tilde, &forced.interval, &forced.model);
    o->indicated = indicated_after(indicated_before, before, o->x_tilde[P_LINE]);
    const real_t shown = inj_shown_under_laws(recorded_of(indicated_before, o->indicated), &o->of_tilde);
    if (o->known > LOOKAHEAD + RECORDED_EARLY) {
        const uint32_t recorded = (number + RECORDED_LATE - RECORDED_EARLY) & LIFT_RING_MASK;
        const real_t found = o->line[recorded] - o->offset - shown;
        if (!isnan(o->line[recorded]) && is_accepted(o, found)) {
            innovation = found;
        }
    }
    return innovation;
}

/* x~ + K e~; p_S gets no gain, its place in the row is that of the indicated pressure. */
static void correct(Observer *o, real_t innovation)
{
    const uint32_t row = (o->since_start < GAIN_ROWS) ? o->since_start : (GAIN_ROWS - 1U);
    const real_t trusted = inj_trusted_under_laws(innovation, &o->of_tilde);
    for (uint32_t i = 0U; i < STATES; ++i) {
        if (i != (uint32_t)P_SAC) {
            o->x_tilde[i] += INJ_GAINS[row][i] * trusted;
        }
    }
    o->indicated += INJ_GAINS[row][P_SAC] * trusted;
}

static void follow_offset(Observer *o, real_t innovation)
{
    if ((OFFSET_MOVES != 0) && (o->since_start > SETTLE) && isfinite(innovation)) {
        const real_t furthest = FURTHEST_OFFSET / PRESSURE_SCALE;
        const real_t moved = o->offset - SENSOR_OFFSET + innovation * SAMPLE_INTERVAL / OFFSET_FOLLOWS;
        o->offset = SENSOR_OFFSET + r_min(r_max(moved, -furthest), furthest);
    }
}

/* The rate of x^ at a sample [m3/s]. */
static real_t rate_of(const Observer *o, Inputs u, bool is_resting, const Model *m)
{
    real_t rate = R(0.0);
    if (!is_resting || (o->x_hat[P_SAC] != R(0.0))) {
        u.area = r_max(u.area, R(0.0));
        rate = inj_injection_rate(o->x_hat, u, m);
    }
    return rate;
}

/* Both systems from the sample before to this one. */
static void step_pair(Observer *o, uint32_t number, Inputs u, bool is_resting, ObserverOutput *output)
{
    const Interval interval = {o->before, u};
    const Model *model = &INJ_MODEL;
    Forced forced;
    real_t total = R(0.0);
    output->innovation = predict(o, &interval, number);
    correct(o, output->innovation);
    if (is_resting) {
        if (inj_is_shut_under_laws(&o->of_tilde)) {
            o->x_tilde[P_SAC] = R(0.0);
        }
        copy_state(o->x_tilde, o->x_hat);
        o->of_hat = o->of_tilde;
    } else {
        inj_under_laws(o->x_hat, &interval, &o->of_hat, &forced);
        inj_advance(o->x_hat, &forced.interval, &forced.model);
        model = &forced.model;
    }
    output->injection_rate = rate_of(o, u, is_resting, model);
    o->since_start = one_more(o->since_start);
    for (uint32_t i = 0U; i < STATES; ++i) {
        total += o->x_hat[i] + o->x_tilde[i];
    }
    if (!isfinite(total)) {
        o->is_synchronised = false;
        start(o, o->line[number & LIFT_RING_MASK]);
        output->injection_rate = R(0.0);
        output->innovation = R(0.0);
    } else if (is_resting) {
        follow_offset(o, output->innovation);
    } else {
        /* x^ runs open loop */
    }
}

/* Synchronised once x~ is good and the sac at rest; no more while the needle stays open beyond all injections. */
static void settle(Observer *o, bool is_resting)
{
    if (!o->front_end.is_open) {
        o->closed_since_start = one_more(o->closed_since_start);
    }
    if (is_resting && (o->closed_since_start >= GOOD)) {
        o->is_synchronised = true;
    }
    o->since_rest = is_resting ? 0U : one_more(o->since_rest);
    const bool is_stuck = o->front_end.is_open && (o->front_end.open_for > (MOST_OPEN + 1U));
    if (is_stuck || (o->since_rest > MOST_RESTLESS)) {
        o->is_synchronised = false;
    }
}

/* Once the first samples are known: in a calm line the needle was shut before them. */
static void look_at_start(Observer *o, uint32_t position, real_t line_pressure)
{
    const real_t count = (real_t)GOOD;
    if (position == 0U) {
        o->first_line = line_pressure;
    }
    if (position < GOOD) {
        const real_t line = line_pressure - o->first_line;
        o->lines += line;
        o->line_squares += line * line;
    } else if (position == GOOD) {
        const real_t mean = o->lines / count;
        const real_t variance = (o->line_squares / count - mean * mean) * (PRESSURE_SCALE * PRESSURE_SCALE);
        if (!o->front_end.is_open && (o->front_end.shut_for == (GOOD + 1U)) && (variance < CALM_SQUARED)) {
            o->front_end.shut_for += SETTLE;
        }
    } else {
        /* the start is over */
    }
}

static void observe(Observer *o, uint32_t number, ObserverOutput *output)
{
    Inputs u;
    const bool is_first = o->known == (LOOKAHEAD + 1U);
    u.area = inj_front_end_area(&o->front_end, number);
    u.rail = o->rail[number & LIFT_RING_MASK];
    look_at_start(o, o->known - (LOOKAHEAD + 1U), o->line[number & LIFT_RING_MASK]);
    const bool is_resting = !o->front_end.is_open && (o->front_end.shut_for > (SETTLE + 1U));
    output->injection_rate = R(0.0);
    output->innovation = R(0.0);
    if (is_first) {
        start(o, o->line[number & LIFT_RING_MASK]);
    } else {
        step_pair(o, number, u, is_resting, output);
    }
    settle(o, is_resting);
    o->before = u;
    output->is_valid = o->is_synchronised;
    output->is_open = u.area > R(0.0);
    if (!o->is_synchronised) {
        output->injection_rate = R(0.0);
    }
    output->innovation *= PRESSURE_SCALE;
    output->observed = in_si(o->x_hat);
    output->followed = in_si(o->x_tilde);
}

bool inj_observer_step(Observer *o, const ObserverInput *input, ObserverOutput *output)
{
    const uint32_t place = o->received & LIFT_RING_MASK;
    o->rail[place] = normalised(RAIL_FACTOR * input->rail_pressure + RAIL_SHIFT);
    o->line[place] = normalised(input->line_pressure);
    o->front_end.lift[place] = input->needle_lift - o->lift_zero;
    o->received += 1U;
    o->known = one_more(o->known);
    const bool has_output = o->known > LOOKAHEAD;
    if (has_output) {
        observe(o, o->received - 1U - LOOKAHEAD, output);
    }
    return has_output;
}
