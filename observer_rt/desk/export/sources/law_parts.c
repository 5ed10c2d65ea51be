/* Parts of which laws are made. */
#include "laws.h"

#define DAMPED R(0.99) /* of what rings no more */

static const real_t LOWEST[LAW_EQUATIONS] = {R(-30.0), R(-15.0), R(-0.8),  R(-0.6), R(-0.6),
                                             R(-0.6),  R(-20.0), R(-10.0), R(-0.1), R(-10.0)};
static const real_t HIGHEST[LAW_EQUATIONS] = {R(30.0), R(15.0), R(0.8),  R(0.6), R(0.6),
                                              R(4.0),  R(20.0), R(10.0), R(0.1), R(10.0)};

void inj_laws_init(LawMemory *memory)
{
    for (uint32_t i = 0U; i < LAW_LAGS; ++i) {
        memory->lags[i] = (real_t)NAN;
    }
    for (uint32_t i = 0U; i < LAW_RINGINGS; ++i) {
        for (uint32_t k = 0U; k < 3U; ++k) {
            memory->ringings[i][k] = (real_t)NAN;
            memory->notches[i][k] = (real_t)NAN;
        }
    }
}

real_t inj_law_held(real_t value, uint32_t equation)
{
    return isfinite(value) ? r_min(r_max(value, LOWEST[equation]), HIGHEST[equation]) : R(0.0);
}

real_t inj_law_lagged(real_t *before, real_t now, real_t intervals)
{
    *before = isfinite(*before) ? (*before - r_expm1(-intervals) * (now - *before)) : now;
    return *before;
}

real_t inj_law_ringing(real_t memory[3], real_t now, real_t kilohertz, real_t damping, real_t interval_ms)
{
    real_t added = memory[1];
    real_t change = memory[2];
    if (!isfinite(memory[0] + added + change)) {
        added = R(0.0);
        change = R(0.0);
    } else {
        const real_t turn = R(2.0) * REAL_PI * kilohertz;
        const real_t fade = damping * turn;
        const real_t swing = turn * r_sqrt(R(1.0) - damping * damping);
        const real_t slope = (now - memory[0]) / interval_ms;
        const real_t steady = R(-2.0) * damping / turn * slope; /* where it would settle on this line */
        const real_t off = added - steady;
        const real_t rate = change - slope;
        const real_t left = r_exp(-fade * interval_ms);
        const real_t cosine = r_cos(swing * interval_ms);
        const real_t sine = r_sin(swing * interval_ms) / swing;
        added = steady + left * (off * cosine + (rate + fade * off) * sine);
        change = slope + left * (rate * cosine - (turn * turn * off + fade * rate) * sine);
    }
    memory[0] = now;
    memory[1] = added;
    memory[2] = change;
    return added;
}

/* An innovation behind a notch at the frequency of a resonance of the sensor. */
real_t inj_law_without(real_t memory[3], real_t innovation, real_t kilohertz, real_t damping, real_t interval_ms)
{
    (void)inj_law_ringing(memory, innovation, kilohertz, DAMPED, interval_ms);
    return innovation - R(2.0) * (DAMPED - damping) * (memory[2] / (R(2.0) * REAL_PI * kilohertz));
}

real_t inj_law_quotient(real_t a, real_t b)
{
    real_t found;
    if (b != R(0.0)) {
        found = a / b;
    } else if ((a == R(0.0)) || isnan(a)) {
        found = (real_t)NAN;
    } else {
        found = r_copysign((real_t)INFINITY, a) * r_copysign(R(1.0), b);
    }
    return found;
}

real_t inj_law_power(real_t a, real_t exponent)
{
    return (exponent == R(2.0)) ? (a * a) : r_pow(a, exponent);
}

real_t inj_law_root(real_t a)
{
    return r_copysign(r_sqrt(r_fabs(a)), a);
}

real_t inj_law_min(real_t a, real_t b)
{
    return (isnan(a) || isnan(b)) ? (real_t)NAN : r_min(a, b);
}

real_t inj_law_max(real_t a, real_t b)
{
    return (isnan(a) || isnan(b)) ? (real_t)NAN : r_max(a, b);
}
