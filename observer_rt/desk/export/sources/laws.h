/* Laws in force, corrections of one equation of the model each; parts they are made of. */
#ifndef LAWS_H
#define LAWS_H

#include "parameters.h"

/* Variables, in printed units: MPa, mm3/ms, mm, mm/ms, MPa/ms, ms, s; the last four 0 or 1. */
enum {
    LAW_RAIL_PRESSURE,
    LAW_LINE_PRESSURE,
    LAW_SAC_PRESSURE,
    LAW_CHAMBER_PRESSURE,
    LAW_LINE_FLOW,
    LAW_SEAT_FLOW,
    LAW_NOZZLE_FLOW,
    LAW_NEEDLE_LIFT,
    LAW_LIFT_RATE,
    LAW_RAIL_PRESSURE_RATE,
    LAW_LINE_PRESSURE_RATE,
    LAW_TIME_SINCE_OPENING,
    LAW_TIME,
    LAW_INJECTION_NUMBER,
    LAW_OPEN,
    LAW_CLOSED,
    LAW_OPENING,
    LAW_CLOSING,
    LAW_VARIABLES
};

/* Equations that laws correct. */
enum {
    LAW_OF_LINE_FLOW,
    LAW_OF_LINE_PRESSURE,
    LAW_OF_SEAT_FLOW,
    LAW_OF_NOZZLE_FLOW,
    LAW_OF_STIFFNESS,
    LAW_OF_INERTANCE,
    LAW_OF_CHAMBER_PRESSURE,
    LAW_OF_LINE_PRESSURE_SENSOR,
    LAW_OF_NEEDLE_LIFT,
    LAW_OF_RAIL_PRESSURE,
    LAW_EQUATIONS
};

/* What laws remember; of a ringing: its input, what is added to it, and how fast the sum changes. */
typedef struct {
    real_t lags[LAW_LAGS];
    real_t ringings[LAW_RINGINGS][3];
    real_t notches[LAW_RINGINGS][3];
} LawMemory;

void inj_laws_init(LawMemory *memory);
void inj_laws_of_model(const real_t v[], LawMemory *memory, real_t interval_ms, real_t totals[]);
void inj_laws_of_sensor(const real_t v[], LawMemory *memory, real_t interval_ms, real_t totals[]);
real_t inj_laws_without_ringing(LawMemory *memory, real_t innovation, real_t interval_ms);

real_t inj_law_held(real_t value, uint32_t equation); /* within the equation's bounds; 0 where it is not finite */
real_t inj_law_lagged(real_t *before, real_t now, real_t intervals);
real_t inj_law_ringing(real_t memory[3], real_t now, real_t kilohertz, real_t damping, real_t interval_ms);
real_t inj_law_without(real_t memory[3], real_t innovation, real_t kilohertz, real_t damping, real_t interval_ms);
real_t inj_law_quotient(real_t a, real_t b);
real_t inj_law_power(real_t a, real_t exponent);
real_t inj_law_root(real_t a); /* with the sign of a */
real_t inj_law_min(real_t a, real_t b);
real_t inj_law_max(real_t a, real_t b);

#endif
