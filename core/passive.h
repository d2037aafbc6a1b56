/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The passive law of losses: see dm_ros/mechanism/passive.py.
 */

#ifndef DM_ROS_PASSIVE_H
#define DM_ROS_PASSIVE_H

#include "core.h"

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
