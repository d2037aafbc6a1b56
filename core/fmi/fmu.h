/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * An FMU beneath the functions of the standard, whose versions fmi2.c and fmi3.c have. What it has
 * of variables is in variables.h, which export_fmu writes. Whatever is refused is told in words,
 * and all stays as it was before the call.
 */

#ifndef DM_ROS_FMU_H
#define DM_ROS_FMU_H

#include <stddef.h>

#include "differential.h"

typedef enum { TIME, INPUT, PARAMETER, OUTPUT } causality;

/* A variable; its value reference is its place in the table. */
typedef struct {
    const char *name;
    causality causality;
    int is_integer;
    int is_fixed;          /* not to be set after the initialization */
    double low, high;
    int above_low;         /* the low end itself is not allowed */
    double start;
    const char *allowed;   /* in words */
} variable;

typedef enum { INSTANTIATED = 1, INITIALIZING = 2, STEPPING = 4, TERMINATED = 8 } phase;

/* An instance. It knows nothing of any other, so that each may have a thread of its own. */
typedef struct fmu fmu;

/* A state that may be put back, in plain bytes. */
typedef struct fmu_state fmu_state;

extern const char *const fmu_token;
extern const size_t fmu_state_size;

/*
 * Make an instance with its start values; NULL without memory.
 * complain: is handed what is refused, in words; to: for it.
 */
fmu *fmu_new(void (*complain)(void *to, const char *words), void *to);

/* Tell in words, as printf does, why something is refused; return 0. */
int fmu_refuse(fmu *, const char *format, ...);

/* Return whether an instance is in one of some phases, else 0 after words that name a function. */
int fmu_is_in(fmu *, int phases, const char *function);

/* All others return whether it could be done. */
void fmu_reset(fmu *);
int fmu_set_times(fmu *, double start, int has_stop, double stop);
int fmu_enter(fmu *, phase);

/* The type of a call: there are importers of FMI 2.0 for which all variables are reals. */
typedef enum { REAL, INTEGER, EITHER } type;

int fmu_get(fmu *, unsigned reference, type, double *value);

/* First ask for all, then set all, so that a call is taken whole or not at all. */
int fmu_may_set(fmu *, unsigned reference, type, double value);
void fmu_set(fmu *, unsigned reference, double value);

int fmu_step(fmu *, double at, double length);
double fmu_time(const fmu *);

void fmu_save(const fmu *, fmu_state *);
int fmu_restore(fmu *, const fmu_state *);

#endif
