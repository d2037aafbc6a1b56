/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The adaptive step of a differential under a law of losses, line by line as in Python:
 * dm_ros/motion/adaptive.py, where its reasons are told. Equal inputs give equal bits.
 */

#ifndef DM_ROS_CORE_H
#define DM_ROS_CORE_H

#include <math.h>

enum { HELD = 6, STATE = 7, SOLVED = 17, LOST = 8, KEPT = 8 };
enum { SHAFTS = 5, PORTS = 3, MOMENTS = 5, CLUTCHES = 2 };   /* at most */

static const double FASTEST = 1e150;   /* rad/s^2, of which squares are still numbers */

#define REAL double
#define OF(name) name
#include "types.h"
#undef REAL
#undef OF

/* The Jacobian of the motion, and under the paper's law that of the friction: 1w, 1s, 2w, 2s. */
typedef struct {
    matrix J;
    double F[4];
} slopes;

/* A part of the path of a step, see adaptive.step. */
typedef struct {
    pair y, f;
    slopes at_start;
    double h;
    pair d, c, integral;
    int is_straight;
    const point *here, *there;
} part;

typedef struct law law;

/* A step: what is asked for, and what comes out. */
typedef struct {
    const law *law;
    const void *coefficients;   /* of the law */
    const void *losses;         /* of the paper's law, for its books */
    double u[HELD];             /* what is held in the step */
    double T[3];                /* torques on the ports, N m, for the books of the paper's law */
    double h, tolerance;
    double form[3];             /* of the kinetic energy: m_ww, m_ws, m_ss */
    int has_books;
    const point *start;         /* what is known where the step begins, or NULL */
    const double *seen;         /* the state of a point that was seen, or NULL */
    int broken;   /* a number was divided by zero, which ends the step as it does in Python */
    pair end, integral;
    const point *at_end;        /* one of those here */
    point points[2];
    int coarse;
    double lost[LOST], numerical;
} step;

/* The equations of motion, see adaptive.Law. */
struct law {
    int most_trials;
    double relative;
    void (*evaluate)(step *, double w, double s, point *at);
    slopes (*jacobian)(step *, const point *);
    /* Put what dw/dt, and what ds/dt, grows with per torque on each port into of_w and of_s. */
    void (*torque_slopes)(step *, const point *, double *of_w, double *of_s);
    int (*bends)(const step *, const point *here, const point *there);
    /* Put y and its integral after a step into end and integral; return 0 where none is found. */
    int (*last_resort)(step *, pair y, matrix J, double h, pair *end, pair *integral);
    /* Put what the elements lost in a part into lost, J, and what its error took into taken. */
    void (*book)(step *, const part *, double *lost, double *taken);
};

/* A function of one number, and what it knows. */
typedef struct context {
    step *job;
    double (*value)(const struct context *, double);
    double w_0, s_0, h, slip;
} context;

/* Return a/b; where b is zero the job is broken, as an exception of Python ends it. */
static inline double quotient(step *job, double a, double b)
{
    if (b == 0.0) {
        job->broken = 1;
        return NAN;
    }
    return a / b;
}

/* The one step of a job is watched always. */
static inline int watched(const step *job)
{
    (void)job;
    return 1;
}

static inline int watch(const step *job, int which)
{
    (void)job;
    return which;
}

/* Put a root of a function that grows on the whole into found; return 0 where none is in reach. */
int dm_root(const context *f, double start, double *found);

/* The last resort of the passive law, which makes no energy. */
int dm_implicit_euler(step *job, pair y, matrix J, double h, pair *end, pair *integral);

/* Advance from y; return 0, or -1 where no speed in reach fits or a number divided by zero. */
int dm_advance(step *job, pair y);

#endif
