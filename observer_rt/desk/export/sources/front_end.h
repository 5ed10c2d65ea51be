/* From the recorded lift to the seat area: dead band, look-back to the foot of a ramp, its toe. */
#ifndef FRONT_END_H
#define FRONT_END_H

#include "parameters.h"

#define LIFT_RING_MASK (LIFT_RING - 1U)

typedef struct {
    real_t lift[LIFT_RING]; /* m, without its zero; sample k at k modulo LIFT_RING */
    bool is_open;
    uint32_t shut_for;     /* samples, at most LONG_AGO, as that below */
    uint32_t open_for;
    uint32_t foot;         /* the sample first recorded as open */
    real_t rise;           /* m a sample, of the opening ramp */
    real_t foot_lift;      /* m, a sample before its foot */
    real_t fall;           /* m a sample, of a needle that is recorded as shut and still sinks; 0: none */
    real_t sinking_lift;   /* m */
    real_t area_before[2]; /* normalised, one and two samples before */
} FrontEnd;

void inj_front_end_init(FrontEnd *f);

/* The normalised seat area at a sample, LOOKAHEAD more being in the ring; below 0 beside an opening, for a shut
 * needle. number: of the sample, from 0, modulo 2^32. */
real_t inj_front_end_area(FrontEnd *f, uint32_t number);

#endif
