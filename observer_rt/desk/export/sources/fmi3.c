/* FMI 3.0 for co-simulation. */
#include "fmi.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

EXPORTED String fmi3GetVersion(void) { return "3.0"; }

EXPORTED Status fmi3SetDebugLogging(Instance c, bool on, size_t count, const String categories[]) { return OK_; }

EXPORTED Instance fmi3InstantiateCoSimulation(String name, String token, String resources, bool visible, bool logs,
                                              bool has_events, bool may_return, const uint32_t required[],
                                              size_t count, void *environment, void *log, void *update)
{
    return made(token);
}

EXPORTED Instance fmi3InstantiateModelExchange() { return NULL; }
EXPORTED Instance fmi3InstantiateScheduledExecution() { return NULL; }
EXPORTED void fmi3FreeInstance(Instance c) { free(c); }

EXPORTED Status fmi3EnterInitializationMode(Instance c, bool has_tolerance, double tolerance, double start,
                                            bool has_stop, double stop)
{
    ((Unit *)c)->values[0] = start;
    return OK_;
}

EXPORTED Status fmi3ExitInitializationMode(Instance c)
{
    inj_unit_begin(c);
    return OK_;
}

EXPORTED Status fmi3Terminate(Instance c) { return OK_; }

EXPORTED Status fmi3Reset(Instance c)
{
    inj_unit_reset(c);
    return OK_;
}

EXPORTED Status fmi3GetFloat64(Instance c, const uint32_t vr[], size_t count, double values[], size_t size)
{
    return (size == count) ? got(c, vr, count, values) : ERROR_;
}

EXPORTED Status fmi3SetFloat64(Instance c, const uint32_t vr[], size_t count, const double values[], size_t size)
{
    return (size == count) ? put(c, vr, count, values) : ERROR_;
}

EXPORTED Status fmi3GetBoolean(Instance c, const uint32_t vr[], size_t count, bool values[], size_t size)
{
    Status status = (size == count) ? OK_ : ERROR_;
    for (size_t i = 0U; (i < count) && (status == OK_); ++i) {
        double value = 0.0;
        status = got(c, &vr[i], 1U, &value);
        values[i] = value != 0.0;
    }
    return status;
}

EXPORTED Status fmi3DoStep(Instance c, double from, double duration, bool no_way_back, bool *event, bool *terminate,
                           bool *early, double *last)
{
    const bool is_done = inj_unit_step(c, from, duration);
    *event = false;
    *terminate = false;
    *early = false;
    *last = is_done ? (from + duration) : from;
    return is_done ? OK_ : ERROR_;
}

REFUSED(fmi3EnterEventMode)
REFUSED(fmi3GetFloat32)
REFUSED(fmi3GetInt8)
REFUSED(fmi3GetUInt8)
REFUSED(fmi3GetInt16)
REFUSED(fmi3GetUInt16)
REFUSED(fmi3GetInt32)
REFUSED(fmi3GetUInt32)
REFUSED(fmi3GetInt64)
REFUSED(fmi3GetUInt64)
REFUSED(fmi3GetString)
REFUSED(fmi3GetBinary)
REFUSED(fmi3GetClock)
REFUSED(fmi3SetFloat32)
REFUSED(fmi3SetInt8)
REFUSED(fmi3SetUInt8)
REFUSED(fmi3SetInt16)
REFUSED(fmi3SetUInt16)
REFUSED(fmi3SetInt32)
REFUSED(fmi3SetUInt32)
REFUSED(fmi3SetInt64)
REFUSED(fmi3SetUInt64)
REFUSED(fmi3SetBoolean)
REFUSED(fmi3SetString)
REFUSED(fmi3SetBinary)
REFUSED(fmi3SetClock)
REFUSED(fmi3GetNumberOfVariableDependencies)
REFUSED(fmi3GetVariableDependencies)
REFUSED(fmi3GetFMUState)
REFUSED(fmi3SetFMUState)
REFUSED(fmi3FreeFMUState)
REFUSED(fmi3SerializedFMUStateSize)
REFUSED(fmi3SerializeFMUState)
REFUSED(fmi3DeserializeFMUState)
REFUSED(fmi3GetDirectionalDerivative)
REFUSED(fmi3GetAdjointDerivative)
REFUSED(fmi3EnterConfigurationMode)
REFUSED(fmi3ExitConfigurationMode)
REFUSED(fmi3GetIntervalDecimal)
REFUSED(fmi3GetIntervalFraction)
REFUSED(fmi3GetShiftDecimal)
REFUSED(fmi3GetShiftFraction)
REFUSED(fmi3SetIntervalDecimal)
REFUSED(fmi3SetIntervalFraction)
REFUSED(fmi3SetShiftDecimal)
REFUSED(fmi3SetShiftFraction)
REFUSED(fmi3EvaluateDiscreteStates)
REFUSED(fmi3UpdateDiscreteStates)
REFUSED(fmi3EnterContinuousTimeMode)
REFUSED(fmi3CompletedIntegratorStep)
REFUSED(fmi3SetTime)
REFUSED(fmi3SetContinuousStates)
REFUSED(fmi3GetContinuousStateDerivatives)
REFUSED(fmi3GetEventIndicators)
REFUSED(fmi3GetContinuousStates)
REFUSED(fmi3GetNominalsOfContinuousStates)
REFUSED(fmi3GetNumberOfEventIndicators)
REFUSED(fmi3GetNumberOfContinuousStates)
REFUSED(fmi3EnterStepMode)
REFUSED(fmi3GetOutputDerivatives)
REFUSED(fmi3ActivateModelPartition)
