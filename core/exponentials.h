/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Exponentials of 2x2 matrices: see dm_ros/motion/exponentials.py.
 */

#ifndef DM_ROS_EXPONENTIALS_H
#define DM_ROS_EXPONENTIALS_H

#include "core.h"

/* Return the vector phi_2(Z) v. */
pair dm_apply_phi_2(step *job, double z_11, double z_12, double z_21, double z_22, double v_1,
                 double v_2);

/* Put the way t phi_1(t J) f at the times t = r h into path. */
void dm_way(step *job, matrix J, pair f, double h, int count, const double *r, pair *path);

#endif
