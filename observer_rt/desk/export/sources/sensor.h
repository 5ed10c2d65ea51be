/* The line-pressure sensor: a first-order lag, its signal recorded late. */
#ifndef SENSOR_H
#define SENSOR_H

#include "parameters.h"

/* What it indicates an interval later; exact for a linear pressure. */
static inline real_t indicated_after(real_t indicated, real_t start, real_t end)
{
    real_t found;
    if (SENSOR_LAG < R(1e-3) * SAMPLE_INTERVAL) {
        found = end - SENSOR_LAG / SAMPLE_INTERVAL * (end - start);
    } else {
        const real_t decay = r_exp(-SAMPLE_INTERVAL / SENSOR_LAG);
        const real_t ramp = R(1.0) - SENSOR_LAG / SAMPLE_INTERVAL * (R(1.0) - decay);
        found = decay * indicated + (R(1.0) - decay) * start + ramp * (end - start);
    }
    return found;
}

/* What is recorded of it, a fraction of a sample late. */
static inline real_t recorded_of(real_t before, real_t indicated)
{
    return indicated - SENSOR_FRACTION * (indicated - before);
}

#endif
