/* The injector as the content of an FMU: values by their references in modelDescription.xml. */
#include "unit.h"

#include "unit_token.h"

enum { RAIL = 1, LIFT, RATE, LINE, FLOW, SAC, RECORDED, END };

const uint32_t INJ_UNIT_VALUES = END;
const char *const INJ_UNIT_TOKEN = TOKEN;

bool inj_is_input(uint32_t reference)
{
    return (reference >= (uint32_t)RAIL) && (reference <= (uint32_t)LIFT);
}

void inj_unit_start(Unit *unit)
{
    unit->values[RAIL] = (double)CHAMBER_PRESSURE;
}

void inj_unit_begin(Unit *unit)
{
    inj_injector_init(&unit->injector, (real_t)unit->values[RAIL]);
    unit->values[LINE] = unit->values[RAIL];
    unit->values[SAC] = (double)CHAMBER_PRESSURE;
    unit->values[RECORDED] = unit->values[RAIL];
}

void inj_unit_sample(Unit *unit)
{
    double *values = unit->values;
    InjectorOutput output;
    inj_injector_step(&unit->injector, (real_t)values[RAIL], (real_t)values[LIFT], &output);
    values[RATE] = (double)output.injection_rate;
    values[LINE] = (double)output.line_pressure;
    values[FLOW] = (double)output.line_flow;
    values[SAC] = (double)output.sac_pressure;
    values[RECORDED] = (double)output.recorded_line_pressure;
}
