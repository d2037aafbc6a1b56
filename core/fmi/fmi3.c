/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The functions of FMI 3.0 for co-simulation. All that is refused gets fmi3Error: fmi3Discard
 * would ask the importer to try again, to no other end.
 */

#include "fmi3Functions.h"

#include <stdlib.h>
#include <string.h>

#include "fmu.h"

enum { RUNNING = INSTANTIATED | INITIALIZING | STEPPING, ANY = RUNNING | TERMINATED };

typedef struct {
    fmu *f;
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
} component;

static void complain(void *to, const char *words)
{
    const component *c = to;
    if (c->log)
        c->log(c->environment, fmi3Error, "logStatusError", words);
}

static fmi3Status status(int done)
{
    return done ? fmi3OK : fmi3Error;
}

/* Return the instance behind a pointer that may be called now, else NULL. */
static fmu *ready(fmi3Instance c, int phases, const char *function)
{
    return c && fmu_is_in(((component *)c)->f, phases, function) ? ((component *)c)->f : NULL;
}

static fmi3Status not_offered(fmi3Instance c, const char *function)
{
    return status(c && fmu_refuse(((component *)c)->f, "%s: this FMU does not offer it",
                                  function));
}

static int are_there(fmu *f, const void *references, size_t count, const void *values,
                     size_t values_count)
{
    if (count != values_count)
        return fmu_refuse(f, "there are %lu values for %lu variables",
                          (unsigned long)values_count, (unsigned long)count);
    return !count || (references && values) || fmu_refuse(f, "there are no values");
}

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t count,
                               const fmi3String categories[])
{
    (void)on, (void)count, (void)categories;   /* there are errors alone */
    return status(c != NULL);
}

static fmi3Instance instantiate(const char *token, const char *refusal,
                                fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    component *c = calloc(1, sizeof *c);
    if (!c)
        return NULL;
    c->log = log;
    c->environment = environment;
    if (!refusal) {
        if (!token || strcmp(token, fmu_token))
            refusal = "the instantiation token is not that of this FMU";
        else if (!(c->f = fmu_new(complain, c)))
            refusal = "there is no memory";
    }
    if (refusal) {
        complain(c, refusal);
        free(c);
        return NULL;
    }
    return c;
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean has_events, fmi3Boolean may_return_early,
    const fmi3ValueReference intermediate[], size_t count, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)resources, (void)visible, (void)logging, (void)may_return_early;
    (void)intermediate, (void)count, (void)update;
    return instantiate(token, has_events ? "this FMU has no event mode" : NULL, environment, log);
}

static const char ALONE[] = "this FMU is for co-simulation alone";

fmi3Instance fmi3InstantiateModelExchange(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    (void)name, (void)resources, (void)visible, (void)logging;
    return instantiate(token, ALONE, environment, log);
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
    fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)resources, (void)visible, (void)logging;
    (void)update, (void)lock, (void)unlock;
    return instantiate(token, ALONE, environment, log);
}

void fmi3FreeInstance(fmi3Instance c)
{
    if (c)
        free(((component *)c)->f);
    free(c);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance,
                                       fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean has_stop, fmi3Float64 stop)
{
    fmu *f = ready(c, INSTANTIATED, "fmi3EnterInitializationMode");
    (void)has_tolerance, (void)tolerance;   /* the model has its own */
    return status(f && fmu_set_times(f, start, has_stop, stop) && fmu_enter(f, INITIALIZING));
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    fmu *f = ready(c, INITIALIZING, "fmi3ExitInitializationMode");
    return status(f && fmu_enter(f, STEPPING));
}

fmi3Status fmi3Terminate(fmi3Instance c)
{
    fmu *f = ready(c, STEPPING, "fmi3Terminate");
    return status(f && fmu_enter(f, TERMINATED));
}

fmi3Status fmi3Reset(fmi3Instance c)
{
    fmu *f = ready(c, ANY, "fmi3Reset");
    if (f)
        fmu_reset(f);
    return status(f != NULL);
}

#define GET(function, number_type, wanted) \
    fmi3Status function(fmi3Instance c, const fmi3ValueReference reference[], size_t count, \
                        number_type value[], size_t values) \
    { \
        fmu *f = ready(c, ANY, #function); \
        double number; \
        if (!f || !are_there(f, reference, count, value, values)) \
            return fmi3Error; \
        for (size_t n = 0; n < count; n++) { \
            if (!fmu_get(f, reference[n], wanted, &number)) \
                return fmi3Error; \
            value[n] = (number_type)number; \
        } \
        return fmi3OK; \
    }

#define SET(function, number_type, wanted) \
    fmi3Status function(fmi3Instance c, const fmi3ValueReference reference[], size_t count, \
                        const number_type value[], size_t values) \
    { \
        fmu *f = ready(c, RUNNING, #function); \
        if (!f || !are_there(f, reference, count, value, values)) \
            return fmi3Error; \
        for (size_t n = 0; n < count; n++) \
            if (!fmu_may_set(f, reference[n], wanted, value[n])) \
                return fmi3Error; \
        for (size_t n = 0; n < count; n++) \
            fmu_set(f, reference[n], value[n]); \
        return fmi3OK; \
    }

#define HAS_NONE(function, number_type) \
    fmi3Status function(fmi3Instance c, const fmi3ValueReference reference[], size_t count, \
                        number_type value[], size_t values) \
    { \
        (void)reference, (void)value, (void)values; \
        return count ? not_offered(c, #function) : fmi3OK; \
    }

GET(fmi3GetFloat64, fmi3Float64, REAL)
GET(fmi3GetInt32, fmi3Int32, INTEGER)
SET(fmi3SetFloat64, fmi3Float64, REAL)
SET(fmi3SetInt32, fmi3Int32, INTEGER)
HAS_NONE(fmi3GetFloat32, fmi3Float32)
HAS_NONE(fmi3GetInt8, fmi3Int8)
HAS_NONE(fmi3GetUInt8, fmi3UInt8)
HAS_NONE(fmi3GetInt16, fmi3Int16)
HAS_NONE(fmi3GetUInt16, fmi3UInt16)
HAS_NONE(fmi3GetUInt32, fmi3UInt32)
HAS_NONE(fmi3GetInt64, fmi3Int64)
HAS_NONE(fmi3GetUInt64, fmi3UInt64)
HAS_NONE(fmi3GetBoolean, fmi3Boolean)
HAS_NONE(fmi3GetString, fmi3String)
HAS_NONE(fmi3SetFloat32, const fmi3Float32)
HAS_NONE(fmi3SetInt8, const fmi3Int8)
HAS_NONE(fmi3SetUInt8, const fmi3UInt8)
HAS_NONE(fmi3SetInt16, const fmi3Int16)
HAS_NONE(fmi3SetUInt16, const fmi3UInt16)
HAS_NONE(fmi3SetUInt32, const fmi3UInt32)
HAS_NONE(fmi3SetInt64, const fmi3Int64)
HAS_NONE(fmi3SetUInt64, const fmi3UInt64)
HAS_NONE(fmi3SetBoolean, const fmi3Boolean)
HAS_NONE(fmi3SetString, const fmi3String)

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 at, fmi3Float64 length, fmi3Boolean no_way_back,
                      fmi3Boolean *needs_events, fmi3Boolean *ends, fmi3Boolean *is_early,
                      fmi3Float64 *time)
{
    fmu *f = ready(c, STEPPING, "fmi3DoStep");
    const int done = f && fmu_step(f, at, length);
    (void)no_way_back;
    if (needs_events)
        *needs_events = fmi3False;
    if (ends)
        *ends = fmi3False;
    if (is_early)
        *is_early = fmi3False;
    if (f && time)
        *time = fmu_time(f);
    return status(done);
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *to)
{
    fmu *f = ready(c, ANY, "fmi3GetFMUState");
    if (!f || !to || !(*to = *to ? *to : malloc(fmu_state_size)))
        return fmi3Error;
    fmu_save(f, *to);
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState from)
{
    fmu *f = ready(c, ANY, "fmi3SetFMUState");
    return status(f && from && fmu_restore(f, from));
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *which)
{
    if (!c)
        return fmi3Error;
    if (which) {
        free(*which);
        *which = NULL;
    }
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState which, size_t *size)
{
    if (!c || !which || !size)
        return fmi3Error;
    *size = fmu_state_size;
    return fmi3OK;
}

/* Return whether bytes are as many as those of a state, else 0 after words. */
static int has_size(fmi3Instance c, size_t size)
{
    return size == fmu_state_size
        || fmu_refuse(((component *)c)->f, "a state has %lu bytes, not %lu",
                      (unsigned long)fmu_state_size, (unsigned long)size);
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState which, fmi3Byte bytes[],
                                 size_t size)
{
    if (!c || !which || !bytes || !has_size(c, size))
        return fmi3Error;
    memcpy(bytes, which, size);
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size,
                                   fmi3FMUState *to)
{
    if (!c || !bytes || !to || !has_size(c, size) || !(*to = *to ? *to : malloc(size)))
        return fmi3Error;
    memcpy(*to, bytes, size);
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c, size_t *count)
{
    if (c && count)
        *count = 0;
    return status(c && count);
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c, size_t *count)
{
    return fmi3GetNumberOfContinuousStates(c, count);
}

/* What the model description does not declare has to be there, but not to do anything. */
#define NOT_OFFERED(function, ...) \
    fmi3Status function(fmi3Instance c, __VA_ARGS__) \
    { \
        return not_offered(c, #function); \
    }
#define NOT_OFFERED_ALONE(function) \
    fmi3Status function(fmi3Instance c) \
    { \
        return not_offered(c, #function); \
    }

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

NOT_OFFERED_ALONE(fmi3EnterEventMode)
NOT_OFFERED_ALONE(fmi3EnterStepMode)
NOT_OFFERED_ALONE(fmi3EnterConfigurationMode)
NOT_OFFERED_ALONE(fmi3ExitConfigurationMode)
NOT_OFFERED_ALONE(fmi3EnterContinuousTimeMode)
NOT_OFFERED_ALONE(fmi3EvaluateDiscreteStates)
NOT_OFFERED(fmi3GetBinary, const fmi3ValueReference r[], size_t n, size_t sizes[],
            fmi3Binary values[], size_t count)
NOT_OFFERED(fmi3SetBinary, const fmi3ValueReference r[], size_t n, const size_t sizes[],
            const fmi3Binary values[], size_t count)
NOT_OFFERED(fmi3GetClock, const fmi3ValueReference r[], size_t n, fmi3Clock values[])
NOT_OFFERED(fmi3SetClock, const fmi3ValueReference r[], size_t n, const fmi3Clock values[])
NOT_OFFERED(fmi3GetNumberOfVariableDependencies, fmi3ValueReference r, size_t *count)
NOT_OFFERED(fmi3GetVariableDependencies, fmi3ValueReference r, size_t elements[],
            fmi3ValueReference on[], size_t of[], fmi3DependencyKind kinds[], size_t count)
NOT_OFFERED(fmi3GetDirectionalDerivative, const fmi3ValueReference unknowns[], size_t m,
            const fmi3ValueReference knowns[], size_t n, const fmi3Float64 seed[], size_t seeds,
            fmi3Float64 values[], size_t count)
NOT_OFFERED(fmi3GetAdjointDerivative, const fmi3ValueReference unknowns[], size_t m,
            const fmi3ValueReference knowns[], size_t n, const fmi3Float64 seed[], size_t seeds,
            fmi3Float64 values[], size_t count)
NOT_OFFERED(fmi3GetOutputDerivatives, const fmi3ValueReference r[], size_t n,
            const fmi3Int32 orders[], fmi3Float64 values[], size_t count)
NOT_OFFERED(fmi3GetIntervalDecimal, const fmi3ValueReference r[], size_t n, fmi3Float64 values[],
            fmi3IntervalQualifier qualifiers[])
NOT_OFFERED(fmi3GetIntervalFraction, const fmi3ValueReference r[], size_t n, fmi3UInt64 counters[],
            fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
NOT_OFFERED(fmi3GetShiftDecimal, const fmi3ValueReference r[], size_t n, fmi3Float64 values[])
NOT_OFFERED(fmi3GetShiftFraction, const fmi3ValueReference r[], size_t n, fmi3UInt64 counters[],
            fmi3UInt64 resolutions[])
NOT_OFFERED(fmi3SetIntervalDecimal, const fmi3ValueReference r[], size_t n,
            const fmi3Float64 values[])
NOT_OFFERED(fmi3SetIntervalFraction, const fmi3ValueReference r[], size_t n,
            const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NOT_OFFERED(fmi3SetShiftDecimal, const fmi3ValueReference r[], size_t n,
            const fmi3Float64 values[])
NOT_OFFERED(fmi3SetShiftFraction, const fmi3ValueReference r[], size_t n,
            const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NOT_OFFERED(fmi3UpdateDiscreteStates, fmi3Boolean *again, fmi3Boolean *ends,
            fmi3Boolean *new_nominals, fmi3Boolean *new_values, fmi3Boolean *has_next,
            fmi3Float64 *next)
NOT_OFFERED(fmi3CompletedIntegratorStep, fmi3Boolean no_way_back, fmi3Boolean *events,
            fmi3Boolean *ends)
NOT_OFFERED(fmi3SetTime, fmi3Float64 time)
NOT_OFFERED(fmi3SetContinuousStates, const fmi3Float64 values[], size_t count)
NOT_OFFERED(fmi3GetContinuousStateDerivatives, fmi3Float64 values[], size_t count)
NOT_OFFERED(fmi3GetEventIndicators, fmi3Float64 values[], size_t count)
NOT_OFFERED(fmi3GetContinuousStates, fmi3Float64 values[], size_t count)
NOT_OFFERED(fmi3GetNominalsOfContinuousStates, fmi3Float64 values[], size_t count)
NOT_OFFERED(fmi3ActivateModelPartition, fmi3ValueReference clock, fmi3Float64 time)
