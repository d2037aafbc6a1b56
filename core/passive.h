/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The passive law of losses: see dm_ros/mechanism/passive.py.
 */

#ifndef DM_ROS_PASSIVE_H
#define DM_ROS_PASSIVE_H

#include "core.h"

/* What does not change while the parameters stay, in the order of passive.Coefficients. */
typedef struct {
    double sign_speed, g_12, k_1, k_2, g_F, I_0, I_1, I_2, I_3, I_s, l_0, l_1, l_2, l_3, l_s;
    double mean_1, mean_2, mean_F, half_1, half_2, half_F, bearing_0, bearing_3;
    double a_1, a_2, phi_1, phi_2, psi_1, psi_2;
} coefficients;

/* What is held in a step, N m. */
enum { T_IN, T_ONE, T_TWO, S_ONE, S_TWO };

extern const law dm_passive;

/* Return whether the numbers of all sets of signs stay in the range of floating point. */
int dm_has_solutions(const coefficients *);

/* Put the power that each element takes into lost, W. */
void dm_lost_powers(const step *job, const point *at, double *lost);

/* Put what the elements lost in a part into lost, J, and what its error took into taken. */
void dm_passive_book(step *job, const part *path, double *lost, double *taken);

#endif
