/* The observer as the content of an FMU: values by their references in modelDescription.xml. */
#include "unit.h"

#include "unit_token.h"

enum { RAIL = 1, LIFT, LINE, ZERO, RATE, INNOVATION, OBSERVED, FOLLOWED = OBSERVED + 3, VALID = FOLLOWED + 3, OPEN, END };

const uint32_t INJ_UNIT_VALUES = END;
const char *const INJ_UNIT_TOKEN = TOKEN;

bool inj_is_input(uint32_t reference)
{
    return (reference >= (uint32_t)RAIL) && (reference <= (uint32_t)ZERO);
}

static void show(double *values, const InjectorState *state)
{
    values[0] = (double)state->line_pressure;
    values[1] = (double)state->line_flow;
    values[2] = (double)state->sac_pressure;
}

void inj_unit_start(Unit *unit)
{
    unit->values[RAIL] = (double)CHAMBER_PRESSURE;
    unit->values[LINE] = (double)CHAMBER_PRESSURE;
    unit->values[ZERO] = (double)LIFT_ZERO;
}

void inj_unit_begin(Unit *unit)
{
    inj_observer_init(&unit->observer);
}

void inj_unit_sample(Unit *unit)
{
    double *values = unit->values;
    const ObserverInput input = {(real_t)values[RAIL], (real_t)values[LIFT], (real_t)values[LINE]};
    ObserverOutput output;
    unit->observer.lift_zero = (real_t)values[ZERO];
    if (inj_observer_step(&unit->observer, &input, &output)) {
        values[RATE] = (double)output.injection_rate;
        values[INNOVATION] = (double)output.innovation;
        values[VALID] = output.is_valid ? 1.0 : 0.0;
        values[OPEN] = output.is_open ? 1.0 : 0.0;
        show(values + OBSERVED, &output.observed);
        show(values + FOLLOWED, &output.followed);
    }
}
