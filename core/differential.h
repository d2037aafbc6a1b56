/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * A differential as a whole, in plain structs that may be copied as bytes: a model is made of its
 * parameters, a state is advanced by ticks under it, and asked for what it reports. It is what
 * dm_ros/motion/simulation.py does, for ports that take torques; equal inputs give equal bits.
 */

#ifndef DM_ROS_DIFFERENTIAL_H
#define DM_ROS_DIFFERENTIAL_H

#include "clutched.h"
#include "linear.h"
#include "passive.h"

enum { SYMMETRIC = 37, SELF_LOCKING = 33 };   /* parameters of each mechanism */

/* What a run has beside its parameters; all numbers, as Python packs them. */
typedef struct {
    double is_symmetric, is_passive, is_lagged, has_clutches;
    double substeps, dt, deadband;   /* 1, s, W */
} setup;

/* What does not change while the parameters stay. */
typedef struct {
    setup run;
    double h, tolerance;                       /* of a solver step, s, rad/s */
    double g_12, k_1, k_2, g_F, g_2s;          /* of the shafts; g_F is 0 without a final drive */
    double sign_speed;
    double form[3];                            /* of the kinetic energy in (w, s) */
    double phi[CLUTCHES], preload[CLUTCHES];   /* full friction of the clutches, see clutched.py */
    double f[CLUTCHES], radius[CLUTCHES], coast[CLUTCHES];
    double limit[CLUTCHES], rise[CLUTCHES];    /* of their actuators */
    union laws {
        coefficients passive;
        struct {                               /* direct flow, reverse flow */
            clutched_coefficients k[2];
            union {
                self_locking_losses self_locking;
                symmetric_losses symmetric;
            } losses[2];
        } paper;
        linear exact[2];                       /* paper's law without clutches, by flow */
    } law;
} model;

/* What a differential reports at the end of a tick, as state.Snapshot. */
typedef struct {
    double velocity[SHAFTS], position[SHAFTS], moment[MOMENTS];
} report;

enum { ENTRIES = 14, RETURNING = 5 };   /* of the books, at most */

/* The books of the ticks, as in motion/books.py. */
typedef struct {
    double tick[ENTRIES], total[ENTRIES], stored, changes, worst;
    double returned_ticks[RETURNING], returned[RETURNING];
} books;

/* How many there are of each in a model. */
int dm_shafts(const model *);
int dm_moments(const model *);
int dm_gears(const model *);
int dm_bearings(const model *);
int dm_entries(const model *);

/*
 * Make a model of parameters, which are the numbers of the table of its mechanism in its order
 * (dm_ros/mechanism/parameters.py); each of them is in its range already.
 * Return 0, or -1 where they make no mechanism: it locks itself, or has no finite solution.
 */
int dm_make(model *, const setup *, const double *parameters);

/* Go back to the start, with these speeds of the two output shafts, rad/s. */
void dm_reset(const model *, state *, const double *velocity);

/* Go on under another model: the speeds of the output shafts and all angles stay. */
void dm_adopt(const model *before, const model *after, state *);

/* Begin the books at a state; or note that it has become another one without any work. */
void dm_begin_books(const model *, const state *, books *);
void dm_note_change(const model *, const state *, books *);

/* Add a solver step to the entries of a tick, and a tick to the books. */
void dm_book_step(const model *, int is_first, const double *x, const pair *end,
                  const double *work, const double *lost, double numerical, double *tick);
void dm_book_tick(const model *, const state *, const double *tick, books *);

/*
 * Advance one tick.
 * torques: N m, finite. forces: N, finite, at least 0; NULL without clutches.
 * known: the patterns of this model that were met, as many as there is room for; see linear.h.
 * kept: the books, or NULL. told: what is reported after the tick, or NULL.
 * Return 0, or -1 where that leads out of the range of numbers: the state stays what it was.
 */
int dm_tick(const model *, state *, patterns *known, const double *torques, const double *forces,
            books *kept, report *told);

/* Put what is reported after the last tick, or at the start, into told; return 0 or -1. */
int dm_report(const model *, const state *, patterns *known, report *told);

#endif
