/* The injector alone, for a plant of a test rig: true rail pressure and lift in, line pressure and rate out. */
#ifndef INJECTOR_H
#define INJECTOR_H

#include "forcing.h"

typedef struct {
    real_t injection_rate;         /* m3/s */
    real_t line_pressure;          /* Pa, at the closed end */
    real_t line_flow;              /* m3/s, into it */
    real_t sac_pressure;           /* Pa */
    real_t recorded_line_pressure; /* Pa, as the sensor shows it; never early */
} InjectorOutput;

typedef struct {
    real_t x[STATES];
    real_t indicated;
    real_t shown_before[RECORDED_LATE + 1U]; /* what the sensor shows, of the last samples */
    uint32_t steps;                          /* modulo RECORDED_LATE + 1 */
    Inputs before;
    Forcing forcing;
} Injector;

/* At rest at a rail pressure [Pa], the needle shut. */
void inj_injector_init(Injector *injector, real_t rail_pressure);

/* A sample interval on, over which rail pressure [Pa] and lift [m] go straight from the values of the step before. */
void inj_injector_step(Injector *injector, real_t rail_pressure, real_t needle_lift, InjectorOutput *output);

#endif
