/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * One of many differentials, and how a tick of some is asked for.
 */

#ifndef DM_ROS_MEMBER_H
#define DM_ROS_MEMBER_H

#include <stddef.h>

#include "../differential.h"

enum { ROOM = 2 };   /* patterns of signs that are kept */

/* What moves of one of many, beside its model. */
typedef struct {
    state now;
    int failed;
    patterns known;
    pattern kept[ROOM];
} member;

enum { COLUMNS = SHAFTS + SHAFTS + MOMENTS + 5 };   /* of what a member reports */

/* What is done in a call. */
typedef struct {
    const model *models;
    member *members;
    const double *torques;   /* N m; those of a tick and a member begin at tick of_tick + member */
    const double *forces;    /* of_member; N, likewise with 2/3 of that, or NULL */
    double *rows;            /* (ticks, count, COLUMNS), or NULL */
    ptrdiff_t count, ticks, of_tick, of_member;
} task;

/* Give the patterns of a member their room, which may have moved. */
patterns *dm_known_of(member *);

/* Advance a member by one tick of a task. */
void dm_member_tick(const task *, ptrdiff_t n, ptrdiff_t t);

/*
 * Advance 2, 4 or 8 members, of which n is the first, by all ticks of a task; the bits are those
 * of dm_member_tick. Not for lagged friction, nor a symmetric one with clutches under the paper's
 * law.
 */
typedef void stepper(const task *, ptrdiff_t n);
extern stepper dm_step_2, dm_step_4, dm_step_8;

#endif
