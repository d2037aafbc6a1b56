/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Exact steps of a symmetric differential, which is linear while no sign changes: see
 * dm_ros/motion/held_torque.py and patterns.py.
 */

#ifndef DM_ROS_LINEAR_H
#define DM_ROS_LINEAR_H

#include "passive.h"

/* The accelerations A x + B T and the moments (M_F, M_1, M_2) = P x + Q T, in x = (w, s). */
typedef struct {
    double A[2][2], B[2][3], P[3][2], Q[3][3];
} response;

/* In the order of losses.SymmetricLosses. */
typedef struct {
    double drag_w, drag_s, pinion_w, carrier_w, carrier_s, mesh_F, mesh_1, mesh_2;
    double pinion_F, pinion_T, pinion_L, carrier_1, carrier_2, carrier_F, carrier_L;
} losses_without_clutches;

/* What is exact for one response and one length of step. */
typedef struct {
    exact map;
    losses_without_clutches lost;
    double second[9];    /* of quadrature.second_moment_of_the_way */
} linear;

/* An exact step of the passive law, and what must hold on its way. */
typedef struct {
    linear exact;
    way way;
    int key, is_none;    /* none: these signs have no exact step */
} pattern;

/* The patterns that a model has met, in as much room as there is; what is in it changes no bit. */
typedef struct {
    int room, met, next, last;
    pattern *kept;
} patterns;

/* Make what is exact; return 0 where a number is divided by zero. */
int dm_make_linear(linear *, const response *, const losses_without_clutches *, double h);

/* Put x after a step, and its integral, into end and integral. */
void dm_exact_step(const linear *, pair x, const double *T, pair *end, pair *integral);

/* Put (M_F, M_1, M_2), as they are reported, into moments. */
void dm_exact_moments(const linear *, pair x, const double *T, double *moments);

/* Put the work on the ports, and what the elements lost, into work and lost, J. */
void dm_exact_book(const linear *, double g_F, double h, pair x, pair end, pair integral,
                   const double *T, double *work, double *lost);

/* Return whether a state is so fast that every sigma is 1 or -1, which exact steps take. */
int dm_has_pattern(const coefficients *, pair x);

/* Return the pattern at a point where all is fast, NULL where there is none. */
const pattern *dm_pattern_at(patterns *known, const coefficients *, double h, double T_in,
                             const point *);

/* As dm_exact_step; return 0 where a sign may not hold all the way. */
int dm_pattern_step(const pattern *, pair x, const double *T, pair *end, pair *integral);

#endif
