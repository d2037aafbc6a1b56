/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The adaptive step: see dm_ros/motion/adaptive.py and roots.py.
 */

#include <math.h>

#include "books.h"
#include "exponentials.h"

static const double RELATIVE = 1e-12, BACKWARD = 3.0, SAFETY = 0.8, SHRINK = 0.1, GROW = 5.0;
static const double XTOL = 1e-12, RTOL = 1.0 / 1125899906842624.0;   /* 2^-50 */
enum { MOST_TRIALS = 400, NEWTON = 30, MOST_RESORTS = 1000, DOUBLINGS = 60, MOST_STEPS = 200 };

/* Return h (3 I - |h| J)^-1 (f(there) - f(here) - J d) of two points that are d apart. */
static pair nonlinear_part(step *job, const point *here, const point *there, matrix J, double h,
                           double d_w, double d_s)
{
    const double D_w = h * (there->e_0 - here->e_0 - J.ww * d_w - J.ws * d_s);
    const double D_s = h * (there->e_s - here->e_s - J.sw * d_w - J.ss * d_s);
    const double k = fabs(h);
    const double a = 3 - k * J.ww, b = k * J.ws, c = k * J.sw, d = 3 - k * J.ss;
    const double det = a * d - b * c;
    return (pair){dm_quotient(job, d * D_w + b * D_s, det), dm_quotient(job, c * D_w + a * D_s, det)};
}

/* A function of one number, and what it knows. */
typedef struct context {
    step *job;
    double (*value)(const struct context *, double);
    double w_0, s_0, h, slip;
} context;

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
                const double d_before = dm_quotient(f->job, f_before - f_at, before - at);
                const double d_across = dm_quotient(f->job, f_across - f_at, across - at);
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
static int root(const context *f, double start, double *found)
{
    double guess = -f->value(f, start);
    if (guess == 0.0) {
        *found = start;
        return 1;
    }
    for (int n = 0; n < DOUBLINGS; n++) {
        if (f->value(f, start + guess) * guess >= 0.0)
            return bracketed_root(f, start, start + guess, found);
        guess *= 2.0;
    }
    *found = start;
    return start + guess == start;
}

static double carrier_residual(const context *f, double w)
{
    return w - f->w_0 - f->h * dm_evaluate(f->job, w, f->slip).e_0;
}

/* Return the carrier speed that fits a slip, NaN where none does, which no root survives. */
static double carrier(const context *f, double slip)
{
    context inner = *f;
    double w;
    inner.value = carrier_residual;
    inner.slip = slip;
    return root(&inner, f->w_0, &w) ? w : NAN;
}

static double slip_residual(const context *f, double slip)
{
    return slip - f->s_0 - f->h * dm_evaluate(f->job, carrier(f, slip), slip).e_s;
}

/* Return whether y_end = y + h f(y_end), but for what a root leaves where f is steep. */
static int solved(step *job, pair y, pair end, double h)
{
    const double d_w = end.w - y.w, d_s = end.s - y.s;
    const point at = dm_evaluate(job, end.w, end.s);
    return fabs(d_w - h * at.e_0) + fabs(d_s - h * at.e_s)
        <= 1e-4 + 1e-6 * (fabs(d_w) + fabs(d_s));
}

static int newton(step *job, pair y, double h, pair *end)
{
    double w = y.w, s = y.s;
    for (int n = 0; n < NEWTON; n++) {
        const point at = dm_evaluate(job, w, s);
        const matrix J = dm_jacobian(job, &at);
        const double r_w = w - y.w - h * at.e_0, r_s = s - y.s - h * at.e_s;
        const double a = 1 - h * J.ww, b = -h * J.ws, c = -h * J.sw, d = 1 - h * J.ss;
        const double det = a * d - b * c;
        const double d_w = dm_quotient(job, d * r_w - b * r_s, det);
        const double d_s = dm_quotient(job, a * r_s - c * r_w, det);
        if (job->broken)
            return 0;
        w = w - d_w;
        s = s - d_s;
        if (fabs(d_w) + fabs(d_s) <= 1e-12 * (fabs(w) + fabs(s)) + 1e-12) {
            *end = (pair){w, s};
            return solved(job, y, *end, h) && !job->broken;
        }
    }
    return 0;
}

/* Put the end of a step that makes no energy into end; return 0 where none is found. */
static int implicit_euler(step *job, pair y, double h, pair *end)
{
    if (newton(job, y, h, end))
        return 1;
    job->broken = 0;
    context f = {job, slip_residual, y.w, y.s, h, 0.0};
    double slip;
    const int is_found = root(&f, y.s, &slip);
    const double w = is_found ? carrier(&f, slip) : NAN;
    if (!is_found || isnan(w) || job->broken) {
        job->broken = 0;
        return 0;
    }
    *end = (pair){w, slip};
    return solved(job, y, *end, h);
}

/* Book a part of the path; the first one is what it is, the others are added. */
static void book(step *job, int is_first, const part *path)
{
    double lost[LOST], taken;
    if (!job->has_books)
        return;
    dm_book_part(job, path, lost, &taken);
    for (int n = 0; n < LOST; n++)
        job->lost[n] = is_first ? lost[n] : job->lost[n] + lost[n];
    job->numerical = is_first ? taken : job->numerical + taken;
}

int dm_advance(step *job, pair y)
{
    double w = y.w, s = y.s, angle_w = 0.0, angle_s = 0.0;
    double left = job->h, h = job->h;
    int booked = 0;
    job->broken = job->coarse = 0;
    point here = dm_evaluate(job, w, s), there;
    matrix J = dm_jacobian(job, &here), J_there = J;
    for (int n = 0; n < MOST_TRIALS; n++) {
        const double f_w = here.e_0, f_s = here.e_s;
        const double z_ww = h * J.ww, z_ws = h * J.ws, z_sw = h * J.sw, z_ss = h * J.ss;
        const pair v = dm_apply_phi_2(job, z_ww, z_ws, z_sw, z_ss, f_w, f_s);
        const double d_w = h * (f_w + z_ww * v.w + z_ws * v.s);
        const double d_s = h * (f_s + z_sw * v.w + z_ss * v.s);
        there = dm_evaluate(job, w + d_w, s + d_s);
        double i_w = h * (w + h * v.w), i_s = h * (s + h * v.s);
        const pair c = nonlinear_part(job, &here, &there, J, h, d_w, d_s);
        const double allowed = job->tolerance + RELATIVE * (fabs(d_w) + fabs(d_s));
        double error = dm_quotient(job, fabs(c.w) + fabs(c.s), allowed);
        int is_known = 0;
        if (error <= 1.0) {
            there = dm_evaluate(job, w + d_w + c.w, s + d_s + c.s);
            if (dm_bends(job, &here, &there)) {
                J_there = dm_jacobian(job, &there);
                is_known = 1;
                const pair r = nonlinear_part(job, &there, &here, J_there, -h, -d_w - c.w,
                                              -d_s - c.s);
                const double seen = dm_quotient(job, fabs(r.w) + fabs(r.s), BACKWARD * allowed);
                if (seen > error)
                    error = seen;
            }
        }
        if (job->broken)
            return -1;
        if (error <= 1.0) {
            i_w += h * c.w / 4;
            i_s += h * c.s / 4;
            book(job, !booked++, &(part){{w, s}, {f_w, f_s}, J, h, {d_w, d_s}, c, 0, &here,
                                         &there});
            angle_w += i_w;
            angle_s += i_s;
            w += d_w + c.w;
            s += d_s + c.s;
            left -= h;
            if (left <= 0.0) {
                job->end = (pair){w, s};
                job->integral = (pair){angle_w, angle_s};
                job->at_end = there;
                return job->broken ? -1 : 0;
            }
            J = is_known ? J_there : dm_jacobian(job, &there);
            here = there;
        }
        double scale = error > 1e-3 ? SAFETY * pow(error, -1.0 / 3) : GROW;
        scale = scale > SHRINK ? scale : SHRINK;
        h *= scale < GROW ? scale : GROW;
        if (h > 0.999 * left)
            h = left;
    }
    h = left;
    for (int n = 0; n < MOST_RESORTS; n++) {
        pair end;
        const int is_done = implicit_euler(job, (pair){w, s}, h, &end);
        if (job->broken)
            return -1;
        if (!is_done) {
            h /= 2.0;
            continue;
        }
        there = dm_evaluate(job, end.w, end.s);
        const double d_w = end.w - w, d_s = end.s - s;
        book(job, !booked++, &(part){{w, s}, {d_w, d_s}, J, h, {d_w, d_s}, {0.0, 0.0}, 1, &here,
                                     &there});
        angle_w += h * end.w;
        angle_s += h * end.s;
        left -= h;
        if (left <= 0.0) {
            job->end = end;
            job->integral = (pair){angle_w, angle_s};
            job->at_end = there;
            job->coarse = 1;
            return job->broken ? -1 : 0;
        }
        w = end.w;
        s = end.s;
        here = there;
        J = dm_jacobian(job, &here);
        h = left < 2.0 * h ? left : 2.0 * h;
    }
    return -1;
}
