/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The step of a differential with elastic shafts on some of its ports, under either law: see
 * dm_ros/motion/coupled.py. Equal inputs give equal bits.
 */

#ifndef DM_ROS_COUPLED_H
#define DM_ROS_COUPLED_H

#include "differential.h"
#include "matrices.h"

/* In the order of coupled.HalfShaft. */
typedef struct {
    double port, stiffness, damping, per_w, per_s, inertia;
} half_shaft;

/* What does not change while the parameters stay, as Python packs it. */
typedef struct {
    double is_symmetric, is_passive, elements;   /* elements: what loses, but half-shafts */
    double h, tolerance, most_trials, form[3];   /* most_trials: of parts of a step */
    double count;
    half_shaft shafts[PORTS];
    union laws law;
} coupling;

/* All that is known of one state. */
typedef struct {
    double z[ROWS], slope[ROWS];   /* slope: dz/dt */
    double T[PORTS], u[HELD];
    point at;
} coupled_point;

/* A part of the path of a step; of the last resort, a jump at its start without way. */
typedef struct {
    const coupled_point *here, *there;
    const double *c;
    double h;
    const exponential *e;
    const linear_way *way;
} coupled_part;

enum { COUPLED_LOST = LOST + PORTS };

/* A step: what is asked for, and what comes out. */
typedef struct {
    step job;                          /* of the law under torques; first, as laws get it */
    const coupling *of;
    const law *inner;
    int rows, has_books;               /* rows: of z */
    const half_shaft *shafts[PORTS];   /* those whose outside is held, as many as rows - 2 */
    double scale[PORTS];               /* rad/s of chi for each rad of twist */
    double inputs[PORTS], S[CLUTCHES];
    double h, twists[PORTS];           /* of an Euler step that is sought */
    coupled_point points[2];
    const coupled_point *at_end;
    double integral[ROWS];
    int coarse;
    double lost[COUPLED_LOST], numerical;   /* the half-shafts follow the elements of the law */
} coupled_step;

/* Make a step ready: inputs are torques, N m, or outside speeds, rad/s; held tells these. */
void dm_prepare_coupled(coupled_step *, const coupling *, const double *inputs, const int *held,
                        const double *S, double flow);

/* Advance from the state w, s, twists; return 0, or -1 where no speed in reach fits. */
int dm_advance_coupled(coupled_step *, const double *x);

/* Put dz/dt at z, and what else is known there, into at. */
void dm_look(coupled_step *, const double *z, coupled_point *at);

/* Add what the elements lost in a part, and what its error took. */
void dm_book_coupled(coupled_step *, const coupled_part *);

#endif
