/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * An FMU beneath the functions of the standard: see fmu.h.
 */

#include "fmu.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "quadrature.h"
#include "variables.h"

enum { SET = AT_OUTPUTS - AT_INPUTS, ROOM = 64, WORDS = 1024 };

static const double LATEST = 1e9;   /* ticks in one step: some minutes to make */
static const double CLOSE = 1e-3;   /* of a tick: nearer than that a time is on it */

/* All that goes on, in numbers alone. */
typedef struct {
    double phase, start, stop;   /* 1, s, s */
    double value[SET];           /* inputs and parameters, as they were set */
    double made[SET];            /* those of them that the model was made of */
    state now;
} memory;

struct fmu_state {
    char token[sizeof TOKEN];
    memory all;
};

struct fmu {
    memory all;
    model model;
    patterns known;
    report report;
    int is_changed, is_reported;
    void (*complain)(void *, const char *);
    void *to;
    pattern kept[ROOM];
};

const char *const fmu_token = TOKEN;
const size_t fmu_state_size = sizeof(fmu_state);

int fmu_refuse(fmu *f, const char *format, ...)
{
    char words[WORDS];
    va_list values;
    va_start(values, format);
    vsnprintf(words, sizeof words, format, values);
    va_end(values);
    f->complain(f->to, words);
    return 0;
}

int fmu_is_in(fmu *f, int phases, const char *function)
{
    if ((int)f->all.phase & phases)
        return 1;
    const int now = (int)f->all.phase;
    return fmu_refuse(f, "%s is not allowed %s", function,
                      now == INSTANTIATED ? "before the initialization mode"
                      : now == INITIALIZING ? "in the initialization mode"
                      : now == STEPPING ? "once the initialization mode has ended"
                      : "after the end");
}

static double *value_of(memory *all, unsigned reference)
{
    return all->value + reference - AT_INPUTS;
}

/* Make the model of the values; return 0 where they make none. */
static int make(model *made, const double *value)
{
    setup run = RUN;
    run.substeps = value[AT_SUBSTEPS - AT_INPUTS];
    return !dm_make(made, &run, value + AT_PARAMETERS - AT_INPUTS);
}

static void take(fmu *f, const model *made)
{
    f->model = *made;
    memset(f->kept, 0, sizeof f->kept);
    f->known = (patterns){.room = ROOM, .kept = f->kept};
    f->is_reported = 0;
}

/* Have the model and the state follow the parameters that were set; return 0 where none does. */
static int renew(fmu *f)
{
    memory *all = &f->all;
    model made;
    if (!f->is_changed)
        return 1;
    f->is_changed = 0;
    if (!make(&made, all->value)) {
        char names[WORDS / 2] = "";
        for (unsigned n = AT_PARAMETERS; n < AT_OUTPUTS; n++) {
            const size_t used = strlen(names);
            if (*value_of(all, n) != all->made[n - AT_INPUTS])
                snprintf(names + used, sizeof names - used, "%s%s %.15g", used ? ", " : "",
                         TABLE[n].name, *value_of(all, n));
        }
        memcpy(value_of(all, AT_PARAMETERS), all->made + AT_PARAMETERS - AT_INPUTS,
               sizeof(double) * (AT_OUTPUTS - AT_PARAMETERS));
        return fmu_refuse(f, "%s: not allowed with the other parameters, they make no mechanism: "
                          "a clutch locks itself, the final drive ratio is 0, or its motion has "
                          "no finite solution; the parameters before stay", names);
    }
    if (all->phase == STEPPING)
        dm_adopt(&f->model, &made, &all->now);
    else
        dm_reset(&made, &all->now, value_of(all, AT_INITIAL));
    memcpy(all->made, all->value, sizeof all->made);
    take(f, &made);
    return 1;
}

void fmu_reset(fmu *f)
{
    model made;
    memset(&f->all, 0, sizeof f->all);
    f->all.phase = INSTANTIATED;
    f->all.stop = HUGE_VAL;
    for (unsigned n = AT_INPUTS; n < AT_OUTPUTS; n++)
        *value_of(&f->all, n) = f->all.made[n - AT_INPUTS] = TABLE[n].start;
    make(&made, f->all.value);   /* which export_fmu has tried */
    dm_reset(&made, &f->all.now, value_of(&f->all, AT_INITIAL));
    take(f, &made);
    f->is_changed = 0;
}

static int is_prepared = 0;

#ifdef __GNUC__
__attribute__((constructor))   /* before any thread may ask for an instance */
#endif
static void prepare(void)
{
    if (!is_prepared)
        dm_prepare_rules();
    is_prepared = 1;
}

fmu *fmu_new(void (*complain)(void *, const char *), void *to)
{
    fmu *f = calloc(1, sizeof *f);
    if (!f)
        return NULL;
    prepare();
    f->complain = complain;
    f->to = to;
    fmu_reset(f);
    return f;
}

int fmu_set_times(fmu *f, double start, int has_stop, double stop)
{
    if (!isfinite(start))
        return fmu_refuse(f, "the start time %g is not allowed, it must be finite", start);
    if (has_stop && !(stop >= start))
        return fmu_refuse(f, "the stop time %.15g is not allowed, it must not be before the start "
                          "time %.15g", stop, start);
    f->all.start = start;
    f->all.stop = has_stop ? stop : HUGE_VAL;
    return 1;
}

int fmu_enter(fmu *f, phase next)
{
    if (!renew(f))
        return 0;
    f->all.phase = next;
    return 1;
}

double fmu_time(const fmu *f)
{
    return f->all.start + f->all.now.ticks * RUN.dt;
}

static const variable *known(fmu *f, unsigned reference, type wanted)
{
    if (reference < VARIABLES
        && (wanted == EITHER || TABLE[reference].is_integer == (wanted == INTEGER)))
        return TABLE + reference;
    fmu_refuse(f, "there is no %s variable with the value reference %u",
               wanted == INTEGER ? "integer" : "real", reference);
    return NULL;
}

static double reported(const fmu *f, int n)
{
    const int shafts = dm_shafts(&f->model), moments = dm_moments(&f->model);
    if (n < shafts)
        return f->report.velocity[n];
    if ((n -= shafts) < shafts)
        return f->report.position[n];
    if ((n -= shafts) < PORTS)
        return f->all.now.torque[n];
    if ((n -= PORTS) < moments)
        return f->report.moment[n];
    if ((n -= moments) < 1)
        return f->all.now.flow;
    return f->all.now.force[n - 1];
}

int fmu_get(fmu *f, unsigned reference, type wanted, double *value)
{
    const variable *v = known(f, reference, wanted);
    if (!v)
        return 0;
    if (v->causality == TIME) {
        *value = fmu_time(f);
    } else if (v->causality != OUTPUT) {
        *value = *value_of(&f->all, reference);
    } else {
        if (!renew(f))
            return 0;
        if (!f->is_reported && dm_report(&f->model, &f->all.now, &f->known, &f->report))
            return fmu_refuse(f, "%s: it is out of the range of floating point numbers", v->name);
        f->is_reported = 1;
        *value = reported(f, (int)(reference - AT_OUTPUTS));
    }
    return 1;
}

/* Return whether a variable may have a value. */
static int fits(const variable *v, double value)
{
    return v->low <= value && value <= v->high && !(v->above_low && value == v->low)
        && !(v->is_integer && value != floor(value));
}

int fmu_may_set(fmu *f, unsigned reference, type wanted, double value)
{
    const variable *v = known(f, reference, wanted);
    if (!v)
        return 0;
    if (v->causality != INPUT && v->causality != PARAMETER)
        return fmu_refuse(f, "%s: it cannot be set", v->name);
    if (v->is_fixed && f->all.phase == STEPPING)
        return fmu_refuse(f, "%s: it cannot change while it runs", v->name);
    if (!fits(v, value))
        return fmu_refuse(f, "%s: %.15g is not allowed, it must be %s", v->name, value,
                          v->allowed);
    return 1;
}

void fmu_set(fmu *f, unsigned reference, double value)
{
    double *place = value_of(&f->all, reference);
    if (reference == AT_DEADBAND)   /* no model is made of it */
        f->all.made[reference - AT_INPUTS] = value;
    else if (TABLE[reference].causality == PARAMETER && *place != value)
        f->is_changed = 1;
    *place = value;
}

int fmu_step(fmu *f, double at, double length)
{
    const double ticks = floor(length / RUN.dt + 0.5), off = length / RUN.dt - ticks;
    const double away = (at - fmu_time(f)) / RUN.dt;
    const double beyond = (fmu_time(f) + ticks * RUN.dt - f->all.stop) / RUN.dt;
    state next;
    report told;
    if (!(ticks >= 1.0 && ticks <= LATEST && fabs(off) <= CLOSE))
        return fmu_refuse(f, "a step of %.15g s is not allowed, it must be a whole multiple of "
                          "%.15g s", length, RUN.dt);
    if (!(fabs(away) <= 0.5))
        return fmu_refuse(f, "a step from %.15g s on is not allowed, it must begin where the last "
                          "one ended, at %.15g s", at, fmu_time(f));
    if (beyond > 0.5)
        return fmu_refuse(f, "a step to %.15g s is not allowed, the stop time is %.15g s",
                          fmu_time(f) + ticks * RUN.dt, f->all.stop);
    if (!renew(f))
        return 0;
    next = f->all.now;
    f->model.run.deadband = *value_of(&f->all, AT_DEADBAND);
    for (double n = 1.0; n <= ticks; n += 1.0)
        if (dm_tick(&f->model, &next, &f->known, value_of(&f->all, AT_INPUTS),
                    FORCES ? value_of(&f->all, AT_INPUTS + PORTS) : NULL, NULL,
                    n < ticks ? NULL : &told))
            return fmu_refuse(f, "the inputs lead out of the range of floating point numbers in "
                              "the tick that begins at %.15g s",
                              f->all.start + next.ticks * RUN.dt);
    f->all.now = next;
    f->report = told;
    f->is_reported = 1;
    return 1;
}

void fmu_save(const fmu *f, fmu_state *saved)
{
    memcpy(saved->token, TOKEN, sizeof saved->token);
    saved->all = f->all;
}

/* Return whether all numbers may be there: bytes from outside may hold anything. */
static int are_allowed(const memory *all)
{
    const state *now = &all->now;
    const double *number = (const double *)now;
    for (size_t n = 0; n < offsetof(state, seen) / sizeof *number; n++)
        if (!isfinite(number[n]))
            return 0;
    for (unsigned n = AT_INPUTS; n < AT_OUTPUTS; n++)
        if (!fits(TABLE + n, all->value[n - AT_INPUTS])
            || !fits(TABLE + n, all->made[n - AT_INPUTS]))
            return 0;
    return (now->flow == 1.0 || now->flow == -1.0) && isfinite(all->start) && !isnan(all->stop)
        && (all->phase == INSTANTIATED || all->phase == INITIALIZING || all->phase == STEPPING
            || all->phase == TERMINATED);
}

int fmu_restore(fmu *f, const fmu_state *saved)
{
    model made;
    if (memcmp(saved->token, TOKEN, sizeof saved->token) || !are_allowed(&saved->all))
        return fmu_refuse(f, "a state that is not of this FMU cannot be put back");
    if (memcmp(saved->all.made, f->all.made, sizeof f->all.made)) {
        if (!make(&made, saved->all.made))
            return fmu_refuse(f, "a state that is not of this FMU cannot be put back");
        take(f, &made);
    }
    f->all = saved->all;
    f->is_reported = 0;
    f->is_changed = memcmp(f->all.value + AT_PARAMETERS - AT_INPUTS,
                           f->all.made + AT_PARAMETERS - AT_INPUTS,
                           sizeof(double) * (AT_OUTPUTS - AT_PARAMETERS)) != 0;
    return 1;
}
