/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The books of a step: see PassiveMeter in dm_ros/motion/meters.py, and quadrature.py.
 */

#ifndef DM_ROS_BOOKS_H
#define DM_ROS_BOOKS_H

#include "passive_equations.h"

/* A part of the path of a step, see adaptive.step. */
typedef struct {
    pair y, f;
    matrix J;
    double h;
    pair d, c;
    int is_straight;
    const point *here, *there;
} part;

/* Make the tables of the quadrature, once, before any step. */
void dm_prepare_rules(void);

/* Put what the elements lost in a part into lost, J, and what its error took into taken. */
void dm_book_part(step *job, const part *path, double *lost, double *taken);

#endif
