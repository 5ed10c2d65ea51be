/* What an FMU contains: the observer or the injector, its values by reference, and its steps. */
#ifndef UNIT_H
#define UNIT_H

#include "injector.h"
#include "observer.h"

#define MOST_VALUES 16U

typedef struct {
    double values[MOST_VALUES]; /* by value reference; 0 is the time */
    Observer observer;
    Injector injector;
} Unit;

extern const char *const INJ_UNIT_TOKEN;
extern const uint32_t INJ_UNIT_VALUES;

bool inj_is_input(uint32_t reference); /* or a parameter */
void inj_unit_reset(Unit *unit);       /* start values, 0 but for those of inj_unit_start */
void inj_unit_start(Unit *unit);
void inj_unit_begin(Unit *unit);       /* initialized */
void inj_unit_sample(Unit *unit);      /* one sample on */
bool inj_unit_step(Unit *unit, double from, double duration); /* false where that is no whole number of samples */

#endif
