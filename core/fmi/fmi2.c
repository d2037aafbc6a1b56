/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The functions of FMI 2.0 for co-simulation. All that is refused gets fmi2Error: fmi2Discard
 * would ask the importer to try again, to no other end.
 */

#include "fmi2Functions.h"

#include <stdlib.h>
#include <string.h>

#include "fmu.h"

enum { RUNNING = INSTANTIATED | INITIALIZING | STEPPING, ANY = RUNNING | TERMINATED };

typedef struct {
    fmu *f;
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    char name[256];
} component;

static void complain(void *to, const char *words)
{
    const component *c = to;
    if (c->logger)
        c->logger(c->environment, c->name, fmi2Error, "logStatusError", "%s", words);
}

static fmi2Status status(int done)
{
    return done ? fmi2OK : fmi2Error;
}

/* Return the instance behind a pointer that may be called now, else NULL. */
static fmu *ready(fmi2Component c, int phases, const char *function)
{
    return c && fmu_is_in(((component *)c)->f, phases, function) ? ((component *)c)->f : NULL;
}

static fmi2Status not_offered(fmi2Component c, const char *function)
{
    return status(c && fmu_refuse(((component *)c)->f, "%s: this FMU does not offer it",
                                  function));
}

static int is_there(fmu *f, size_t count, const void *references, const void *values)
{
    return !count || (references && values) || fmu_refuse(f, "there are no values");
}

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count,
                               const fmi2String categories[])
{
    (void)on, (void)count, (void)categories;   /* there are errors alone */
    return status(c != NULL);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token,
                              fmi2String resources, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean logging)
{
    component *c = calloc(1, sizeof *c);
    const char *refusal = NULL;
    (void)resources, (void)visible, (void)logging;
    if (!c)
        return NULL;
    if (functions) {
        c->logger = functions->logger;
        c->environment = functions->componentEnvironment;
    }
    strncpy(c->name, name ? name : "", sizeof c->name - 1);
    if (type != fmi2CoSimulation)
        refusal = "this FMU is for co-simulation alone";
    else if (!token || strcmp(token, fmu_token))
        refusal = "the guid is not that of this FMU";
    else if (!(c->f = fmu_new(complain, c)))
        refusal = "there is no memory";
    if (refusal) {
        complain(c, refusal);
        free(c);
        return NULL;
    }
    return c;
}

void fmi2FreeInstance(fmi2Component c)
{
    if (c)
        free(((component *)c)->f);
    free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean has_stop, fmi2Real stop)
{
    fmu *f = ready(c, INSTANTIATED, "fmi2SetupExperiment");
    (void)has_tolerance, (void)tolerance;   /* the model has its own */
    return status(f && fmu_set_times(f, start, has_stop, stop));
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    fmu *f = ready(c, INSTANTIATED, "fmi2EnterInitializationMode");
    return status(f && fmu_enter(f, INITIALIZING));
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    fmu *f = ready(c, INITIALIZING, "fmi2ExitInitializationMode");
    return status(f && fmu_enter(f, STEPPING));
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    fmu *f = ready(c, STEPPING, "fmi2Terminate");
    return status(f && fmu_enter(f, TERMINATED));
}

fmi2Status fmi2Reset(fmi2Component c)
{
    fmu *f = ready(c, ANY, "fmi2Reset");
    if (f)
        fmu_reset(f);
    return status(f != NULL);
}

#define GET(function, number_type, wanted) \
    fmi2Status function(fmi2Component c, const fmi2ValueReference reference[], size_t count, \
                        number_type value[]) \
    { \
        fmu *f = ready(c, ANY, #function); \
        double number; \
        if (!f || !is_there(f, count, reference, value)) \
            return fmi2Error; \
        for (size_t n = 0; n < count; n++) { \
            if (!fmu_get(f, reference[n], wanted, &number)) \
                return fmi2Error; \
            value[n] = (number_type)number; \
        } \
        return fmi2OK; \
    }

#define SET(function, number_type, wanted) \
    fmi2Status function(fmi2Component c, const fmi2ValueReference reference[], size_t count, \
                        const number_type value[]) \
    { \
        fmu *f = ready(c, RUNNING, #function); \
        if (!f || !is_there(f, count, reference, value)) \
            return fmi2Error; \
        for (size_t n = 0; n < count; n++) \
            if (!fmu_may_set(f, reference[n], wanted, value[n])) \
                return fmi2Error; \
        for (size_t n = 0; n < count; n++) \
            fmu_set(f, reference[n], value[n]); \
        return fmi2OK; \
    }

#define HAS_NONE(function, number_type) \
    fmi2Status function(fmi2Component c, const fmi2ValueReference reference[], size_t count, \
                        number_type value[]) \
    { \
        (void)reference, (void)value; \
        return count ? not_offered(c, #function) : fmi2OK; \
    }

GET(fmi2GetReal, fmi2Real, EITHER)
GET(fmi2GetInteger, fmi2Integer, INTEGER)
SET(fmi2SetReal, fmi2Real, EITHER)
SET(fmi2SetInteger, fmi2Integer, INTEGER)
HAS_NONE(fmi2GetBoolean, fmi2Boolean)
HAS_NONE(fmi2GetString, fmi2String)
HAS_NONE(fmi2SetBoolean, const fmi2Boolean)
HAS_NONE(fmi2SetString, const fmi2String)

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real at, fmi2Real length, fmi2Boolean no_way_back)
{
    fmu *f = ready(c, STEPPING, "fmi2DoStep");
    (void)no_way_back;
    return status(f && fmu_step(f, at, length));
}

fmi2Status fmi2CancelStep(fmi2Component c)
{
    return not_offered(c, "fmi2CancelStep");
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *to)
{
    fmu *f = ready(c, ANY, "fmi2GetFMUstate");
    if (!f || !to || !(*to = *to ? *to : malloc(fmu_state_size)))
        return fmi2Error;
    fmu_save(f, *to);
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate from)
{
    fmu *f = ready(c, ANY, "fmi2SetFMUstate");
    return status(f && from && fmu_restore(f, from));
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *which)
{
    if (!c)
        return fmi2Error;
    if (which) {
        free(*which);
        *which = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate which, size_t *size)
{
    if (!c || !which || !size)
        return fmi2Error;
    *size = fmu_state_size;
    return fmi2OK;
}

/* Return whether bytes are as many as those of a state, else 0 after words. */
static int has_size(fmi2Component c, size_t size)
{
    return size == fmu_state_size
        || fmu_refuse(((component *)c)->f, "a state has %lu bytes, not %lu",
                      (unsigned long)fmu_state_size, (unsigned long)size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate which, fmi2Byte bytes[],
                                 size_t size)
{
    if (!c || !which || !bytes || !has_size(c, size))
        return fmi2Error;
    memcpy(bytes, which, size);
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                   fmi2FMUstate *to)
{
    if (!c || !bytes || !to || !has_size(c, size) || !(*to = *to ? *to : malloc(size)))
        return fmi2Error;
    memcpy(*to, bytes, size);
    return fmi2OK;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[],
                                        size_t unknowns, const fmi2ValueReference known[],
                                        size_t knowns, const fmi2Real seed[], fmi2Real value[])
{
    (void)unknown, (void)unknowns, (void)known, (void)knowns, (void)seed, (void)value;
    return not_offered(c, "fmi2GetDirectionalDerivative");
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference reference[],
                                       size_t count, const fmi2Integer order[],
                                       const fmi2Real value[])
{
    (void)reference, (void)count, (void)order, (void)value;
    return not_offered(c, "fmi2SetRealInputDerivatives");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference reference[],
                                        size_t count, const fmi2Integer order[], fmi2Real value[])
{
    (void)reference, (void)count, (void)order, (void)value;
    return not_offered(c, "fmi2GetRealOutputDerivatives");
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value)
{
    (void)kind, (void)value;
    return not_offered(c, "fmi2GetStatus");
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    if (!c || !value || kind != fmi2LastSuccessfulTime)
        return not_offered(c, "fmi2GetRealStatus");
    *value = fmu_time(((component *)c)->f);
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value)
{
    (void)kind, (void)value;
    return not_offered(c, "fmi2GetIntegerStatus");
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    if (!c || !value || kind != fmi2Terminated)
        return not_offered(c, "fmi2GetBooleanStatus");
    *value = fmi2False;
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
{
    (void)kind, (void)value;
    return not_offered(c, "fmi2GetStringStatus");
}
