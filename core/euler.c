/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The implicit Euler step, which makes no energy: see implicit_euler in dm_ros/motion/adaptive.py.
 */

#include "core.h"

enum { NEWTON = 30 };

static double carrier_residual(const context *f, double w)
{
    point at;
    f->job->law->evaluate(f->job, w, f->slip, &at);
    return w - f->w_0 - f->h * at.e_0;
}

/* Return the carrier speed that fits a slip, NaN where none does, which no root survives. */
static double carrier(const context *f, double slip)
{
    context inner = *f;
    double w;
    inner.value = carrier_residual;
    inner.slip = slip;
    return dm_root(&inner, f->w_0, &w) ? w : NAN;
}

static double slip_residual(const context *f, double slip)
{
    point at;
    f->job->law->evaluate(f->job, carrier(f, slip), slip, &at);
    return slip - f->s_0 - f->h * at.e_s;
}

/* Return whether y_end = y + h f(y_end), but for what a root leaves where f is steep. */
static int solved(step *job, pair y, pair end, double h)
{
    const double d_w = end.w - y.w, d_s = end.s - y.s;
    point at;
    job->law->evaluate(job, end.w, end.s, &at);
    return fabs(d_w - h * at.e_0) + fabs(d_s - h * at.e_s)
        <= 1e-4 + 1e-6 * (fabs(d_w) + fabs(d_s));
}

static int newton(step *job, pair y, double h, pair *end)
{
    double w = y.w, s = y.s;
    for (int n = 0; n < NEWTON; n++) {
        point at;
        job->law->evaluate(job, w, s, &at);
        const matrix J = job->law->jacobian(job, &at).J;
        const double r_w = w - y.w - h * at.e_0, r_s = s - y.s - h * at.e_s;
        const double a = 1 - h * J.ww, b = -h * J.ws, c = -h * J.sw, d = 1 - h * J.ss;
        const double det = a * d - b * c;
        const double d_w = quotient(job, d * r_w - b * r_s, det);
        const double d_s = quotient(job, a * r_s - c * r_w, det);
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

int dm_implicit_euler(step *job, pair y, matrix J, double h, pair *end, pair *integral)
{
    (void)J;
    if (newton(job, y, h, end)) {
        *integral = (pair){h * end->w, h * end->s};
        return 1;
    }
    job->broken = 0;
    context f = {job, slip_residual, y.w, y.s, h, 0.0};
    double slip;
    const int is_found = dm_root(&f, y.s, &slip);
    const double w = is_found ? carrier(&f, slip) : NAN;
    if (!is_found || isnan(w) || job->broken) {
        job->broken = 0;
        return 0;
    }
    *end = (pair){w, slip};
    *integral = (pair){h * w, h * slip};
    return solved(job, y, *end, h);
}
