/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * What the step and its books need of the equations: see dm_ros/mechanism/passive.py.
 */

#ifndef DM_ROS_PASSIVE_EQUATIONS_H
#define DM_ROS_PASSIVE_EQUATIONS_H

#include "passive.h"

/* Return a/b; where b is zero the job is broken, as an exception of Python ends it. */
double dm_quotient(step *job, double a, double b);

/* Return the derivative of the accelerations by w and s at fixed signs. */
matrix dm_jacobian(step *job, const point *at);

/* Return whether the motion from one point to another may be far from linear. */
int dm_bends(const step *job, const point *here, const point *there);

/* Put the power that each element takes into lost, W. */
void dm_lost_powers(const step *job, const point *at, double *lost);

#endif
