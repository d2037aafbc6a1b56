/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * Roots of functions of one number: see dm_ros/motion/roots.py, and root in adaptive.py.
 */

#include "core.h"

static const double XTOL = 1e-12, RTOL = 1.0 / 1125899906842624.0;   /* 2^-50 */
enum { DOUBLINGS = 60, MOST_STEPS = 200 };

static int signs_differ(double a, double b)
{
    return (signbit(a) != 0) != (signbit(b) != 0);
}

/* Put a bracketed root into found; return 0 where there is none. */
static int bracketed_root(const context *f, double start, double end, double *found)
{
    double before = start, at = end;
    double f_before = f->value(f, before), f_at = f->value(f, at);
    double across = 0.0, f_across = 0.0, last = 0.0, leap = 0.0;
    if (f_before == 0.0) {
        *found = before;
        return 1;
    }
    if (f_at == 0.0) {
        *found = at;
        return 1;
    }
    if (isnan(f_before) || isnan(f_at) || !signs_differ(f_before, f_at))
        return 0;
    for (int n = 0; n < MOST_STEPS; n++) {
        if (f_before != 0.0 && f_at != 0.0 && signs_differ(f_before, f_at)) {
            across = before;
            f_across = f_before;
            last = leap = at - before;
        }
        if (fabs(f_across) < fabs(f_at)) {
            before = at;
            at = across;
            across = before;
            f_before = f_at;
            f_at = f_across;
            f_across = f_before;
        }
        const double near = (XTOL + RTOL * fabs(at)) / 2, half = (across - at) / 2;
        if (f_at == 0.0 || fabs(half) < near) {
            *found = at;
            return 1;
        }
        double up = 0.0, down = 0.0;
        if (fabs(last) > near && fabs(f_at) < fabs(f_before)) {
            if (before == across) {
                up = -f_at * (at - before);
                down = f_at - f_before;
            } else {
                const double d_before = quotient(f->job, f_before - f_at, before - at);
                const double d_across = quotient(f->job, f_across - f_at, across - at);
                up = -f_at * (f_across * d_across - f_before * d_before);
                down = d_across * d_before * (f_across - f_before);
            }
        }
        const double most = 3 * fabs(half) - near;
        if (down != 0.0 && 2 * fabs(up / down) < (most < fabs(last) ? most : fabs(last))) {
            last = leap;
            leap = up / down;
        } else {
            last = leap = half;
        }
        before = at;
        f_before = f_at;
        at += fabs(leap) > near ? leap : half > 0.0 ? near : -near;
        f_at = f->value(f, at);
        if (isnan(f_at))
            return 0;
    }
    *found = at;
    return 1;
}

/* Put a root of a function that grows on the whole into found; return 0 where none is in reach. */
int dm_root(const context *f, double start, double *found)
{
    double guess = -f->value(f, start);
    if (guess == 0.0) {
        *found = start;
        return 1;
    }
    if (isnan(guess))   /* nor will any other be a number */
        return 0;
    for (int n = 0; n < DOUBLINGS; n++) {
        if (f->value(f, start + guess) * guess >= 0.0)
            return bracketed_root(f, start, start + guess, found);
        guess *= 2.0;
    }
    *found = start;
    return start + guess == start;
}
