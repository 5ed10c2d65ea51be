/* FMI 2.0 for co-simulation. */
#include "fmi.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

typedef int Boolean;

EXPORTED String fmi2GetTypesPlatform(void) { return "default"; }
EXPORTED String fmi2GetVersion(void) { return "2.0"; }

EXPORTED Status fmi2SetDebugLogging(Instance c, Boolean on, size_t count, const String categories[]) { return OK_; }

EXPORTED Instance fmi2Instantiate(String name, int type, String token, String resources, const void *callbacks,
                                  Boolean visible, Boolean logs)
{
    return (type == 1) ? made(token) : NULL; /* co-simulation only */
}

EXPORTED void fmi2FreeInstance(Instance c) { free(c); }

EXPORTED Status fmi2SetupExperiment(Instance c, Boolean has_tolerance, double tolerance, double start,
                                    Boolean has_stop, double stop)
{
    ((Unit *)c)->values[0] = start;
    return OK_;
}

EXPORTED Status fmi2EnterInitializationMode(Instance c) { return OK_; }

EXPORTED Status fmi2ExitInitializationMode(Instance c)
{
    inj_unit_begin(c);
    return OK_;
}

EXPORTED Status fmi2Terminate(Instance c) { return OK_; }

EXPORTED Status fmi2Reset(Instance c)
{
    inj_unit_reset(c);
    return OK_;
}

EXPORTED Status fmi2GetReal(Instance c, const uint32_t vr[], size_t count, double values[])
{
    return got(c, vr, count, values);
}

EXPORTED Status fmi2SetReal(Instance c, const uint32_t vr[], size_t count, const double values[])
{
    return put(c, vr, count, values);
}

EXPORTED Status fmi2GetBoolean(Instance c, const uint32_t vr[], size_t count, Boolean values[])
{
    Status status = OK_;
    for (size_t i = 0U; (i < count) && (status == OK_); ++i) {
        double value = 0.0;
        status = got(c, &vr[i], 1U, &value);
        values[i] = value != 0.0;
    }
    return status;
}

EXPORTED Status fmi2DoStep(Instance c, double from, double duration, Boolean no_way_back)
{
    return inj_unit_step(c, from, duration) ? OK_ : ERROR_;
}

REFUSED(fmi2GetInteger)
REFUSED(fmi2GetString)
REFUSED(fmi2SetInteger)
REFUSED(fmi2SetBoolean)
REFUSED(fmi2SetString)
REFUSED(fmi2GetFMUstate)
REFUSED(fmi2SetFMUstate)
REFUSED(fmi2FreeFMUstate)
REFUSED(fmi2SerializedFMUstateSize)
REFUSED(fmi2SerializeFMUstate)
REFUSED(fmi2DeSerializeFMUstate)
REFUSED(fmi2GetDirectionalDerivative)
REFUSED(fmi2SetRealInputDerivatives)
REFUSED(fmi2GetRealOutputDerivatives)
REFUSED(fmi2CancelStep)
REFUSED(fmi2GetStatus)
REFUSED(fmi2GetRealStatus)
REFUSED(fmi2GetIntegerStatus)
REFUSED(fmi2GetBooleanStatus)
REFUSED(fmi2GetStringStatus)
