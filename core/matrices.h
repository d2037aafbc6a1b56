/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Matrices of two to five rows, and the ways of linear equations: see dm_ros/motion/matrices.py.
 */

#ifndef DM_ROS_MATRICES_H
#define DM_ROS_MATRICES_H

#include "core.h"

enum { ROWS = 5, MOST_DOUBLINGS = 80, MOST_PLACES = 8 * 64 + 1 };

typedef struct {
    double at[ROWS][ROWS];
} table;

/* The exponential of h J. */
typedef struct {
    int rows, doublings;
    double h, start;
    table J, small, solver;             /* solver: (3 - h J)^-1 */
    table powers[MOST_DOUBLINGS + 1];   /* e^(t J) - 1 of t = h/2^n, ..., h/2, h */
} exponential;

/* The way q of x' = J (x - x_0) + f from x_0. */
typedef struct {
    double f[ROWS], doubled[MOST_DOUBLINGS + 1][ROWS], integral[ROWS];
} linear_way;

/* A rule along a way, at the times t = r h. */
typedef struct {
    int count;
    struct {
        double r, weight, q[ROWS];
    } at[MOST_PLACES];
} places;

/* Put A x into y, which is not x. */
static inline void dm_times(int rows, const table *A, const double *x, double *y)
{
    for (int i = 0; i < rows; i++) {
        double total = A->at[i][0] * x[0];
        for (int j = 1; j < rows; j++)
            total += A->at[i][j] * x[j];
        y[i] = total;
    }
}

/* Return the sum of the magnitudes of a vector. */
static inline double dm_size(int rows, const double *x)
{
    double total = 0.0;
    for (int i = 0; i < rows; i++)
        total += fabs(x[i]);
    return total;
}

/* Put (3 - h J)^-1 into X; where there is none the job is broken. */
void dm_implicit(step *job, int rows, const table *J, double h, table *X);

/* Make it of J; return 0 where its numbers have no common scale. */
int dm_make_exponential(step *job, exponential *made, int rows, const table *J, double h);

void dm_make_way(const exponential *, const double *f, linear_way *made);

/* Put a rule along a way into found, see Exponential.nodes. */
void dm_find_places(const exponential *, const linear_way *, double fit, double speed,
                    places *found);

#endif
