/* Communication steps in samples. */
#include "unit.h"

#define TOLERANCE 1e-3 /* of a sample, by which a step may miss the grid of samples */

void inj_unit_reset(Unit *unit)
{
    for (uint32_t i = 0U; i < MOST_VALUES; ++i) {
        unit->values[i] = 0.0;
    }
    inj_unit_start(unit);
}

bool inj_unit_step(Unit *unit, double from, double duration)
{
    const double wanted = duration / (double)SAMPLE_INTERVAL;
    const double count = floor(wanted + 0.5);
    const bool is_whole = (count >= 1.0) && (fabs(wanted - count) < TOLERANCE * count) && (count < 1e9);
    if (is_whole) {
        for (uint32_t i = 0U; i < (uint32_t)count; ++i) {
            inj_unit_sample(unit);
        }
        unit->values[0] = from + duration;
    }
    return is_whole;
}
