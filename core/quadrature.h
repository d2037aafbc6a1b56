/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Integrals along the path of a step: see dm_ros/motion/quadrature.py.
 */

#ifndef DM_ROS_QUADRATURE_H
#define DM_ROS_QUADRATURE_H

#include "core.h"

enum { MOST_PIECES = 40, MOST_NODES = 4 * MOST_PIECES };

/* Lobatto's rule of five points on [0, 1], in pieces each as long as all before it. */
typedef struct {
    int count;   /* of the nodes inside */
    double r[MOST_NODES], r_2[MOST_NODES], r_3[MOST_NODES], weight[MOST_NODES], begin, end;
} rule;

/* Make the tables, once, before any step. */
void dm_prepare_rules(void);

/* Return the rule that follows a path with the Jacobian J over h; far: meters.leads_far. */
const rule *dm_rule_for(matrix J, double h, int far);

#endif
