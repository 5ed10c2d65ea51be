/* What both versions of FMI share here. */
#ifndef FMI_H
#define FMI_H

#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "unit.h"

#if defined(_WIN32)
#define EXPORTED __declspec(dllexport)
#elif defined(__GNUC__)
#define EXPORTED __attribute__((visibility("default")))
#else
#define EXPORTED
#endif

/* Functions that the capabilities in modelDescription.xml rule out. */
#define REFUSED(name) \
    EXPORTED Status name() { return ERROR_; }

typedef enum { OK_, WARNING_, DISCARD_, ERROR_, FATAL_ } Status;
typedef void *Instance;
typedef const char *String;

static inline Instance made(String token)
{
    Unit *unit = NULL;
    if ((token != NULL) && (strcmp(token, INJ_UNIT_TOKEN) == 0)) {
        unit = calloc(1U, sizeof(Unit));
        if (unit != NULL) {
            inj_unit_reset(unit);
        }
    }
    return unit;
}

static inline Status got(Instance instance, const uint32_t references[], size_t count, double values[])
{
    const Unit *unit = instance;
    for (size_t i = 0U; i < count; ++i) {
        if (references[i] >= INJ_UNIT_VALUES) {
            return ERROR_;
        }
        values[i] = unit->values[references[i]];
    }
    return OK_;
}

static inline Status put(Instance instance, const uint32_t references[], size_t count, const double values[])
{
    Unit *unit = instance;
    for (size_t i = 0U; i < count; ++i) {
        if (!inj_is_input(references[i])) {
            return ERROR_;
        }
        unit->values[references[i]] = values[i];
    }
    return OK_;
}

#endif
