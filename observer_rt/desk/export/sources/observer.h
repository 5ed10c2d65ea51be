/* Observer of an injector: the identification system x~ and the observer x^ from sample to sample, nothing learned.
 *
 * inj_observer_step takes a sample every SAMPLE_INTERVAL and answers for the one LOOKAHEAD samples before. The caller sees
 * to it that samples follow each other without a gap and are plausible, and that the lift of a shut needle is
 * lift_zero; after a gap it calls inj_observer_init.
 */
#ifndef OBSERVER_H
#define OBSERVER_H

#include "forcing.h"
#include "front_end.h"

typedef struct {
    real_t rail_pressure; /* Pa */
    real_t needle_lift;   /* m */
    real_t line_pressure; /* Pa; not a number where there is none: x~ goes on by the model */
} ObserverInput;

typedef struct {
    real_t line_pressure; /* Pa */
    real_t line_flow;     /* m3/s, into the closed end */
    real_t sac_pressure;  /* Pa */
} InjectorState;

typedef struct {
    bool is_valid;          /* x~ has settled since the start; else the rate is 0 */
    bool is_open;           /* the seat */
    real_t injection_rate;  /* m3/s, of x^ */
    real_t innovation;      /* Pa, of x~ */
    InjectorState observed; /* x^ */
    InjectorState followed; /* x~ */
} ObserverOutput;

typedef struct {
    FrontEnd front_end;
    real_t lift_zero;              /* m, of the shut needle; may be set between two steps */
    real_t rail[LIFT_RING];        /* normalised, as the following */
    real_t line[LIFT_RING];
    uint32_t received;             /* samples, modulo 2^32 */
    uint32_t known;                /* the same, at most LONG_AGO */
    uint32_t since_start;          /* samples, at most LONG_AGO, as the following */
    uint32_t closed_since_start;
    uint32_t since_rest;
    real_t first_line;             /* line pressure of the start, and sums of what the next ones differ by */
    real_t lines;
    real_t line_squares;
    bool is_synchronised;
    uint32_t leaping;              /* innovations left out in a row */
    real_t accepted_innovation;
    real_t offset;                 /* of the line-pressure sensor, followed at rest */
    real_t indicated;              /* line pressure by the sensor of x~ */
    Inputs before;                 /* of the sample before */
    real_t x_tilde[STATES];
    real_t x_hat[STATES];
    Forcing of_tilde;
    Forcing of_hat;
} Observer;

void inj_observer_init(Observer *o);

/* Whether there is an output: not for the first LOOKAHEAD samples. */
bool inj_observer_step(Observer *o, const ObserverInput *input, ObserverOutput *output);

#endif
