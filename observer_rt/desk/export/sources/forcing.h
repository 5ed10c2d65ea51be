/* Laws in force: evaluated once a sample, applied over the interval to the next. */
#ifndef FORCING_H
#define FORCING_H

#include "laws.h"
#include "model.h"

typedef struct {
    LawMemory memory;
    real_t variables[LAW_VARIABLES];
    uint64_t samples;       /* since the start */
    real_t injections;      /* openings so far */
    real_t since_opening;   /* ms */
    real_t lift_before;     /* mm */
    real_t pressure_before; /* MPa; not a number: none */
    real_t area;            /* at the end of the last interval */
    Line line;              /* as the laws had it in the last interval */
} Forcing;

/* An interval and the model as the laws have them. */
typedef struct {
    Interval interval;
    Model model;
} Forced;

void inj_forcing_init(Forcing *f);
void inj_under_laws(const real_t x[], const Interval *interval, Forcing *f, Forced *forced);
real_t inj_shown_under_laws(real_t shown, Forcing *f);
bool inj_is_shut_under_laws(const Forcing *f);
real_t inj_trusted_under_laws(real_t innovation, Forcing *f);

#endif
