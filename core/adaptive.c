/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The adaptive step: see dm_ros/motion/adaptive.py.
 */

#include "exponentials.h"

static const double BACKWARD = 3.0, SAFETY = 0.8, SHRINK = 0.1, GROW = 5.0;
enum { MOST_RESORTS = 1000 };

/* Return h (3 I - |h| J)^-1 (f(there) - f(here) - J d) of two points that are d apart. */
static pair nonlinear_part(step *job, const point *here, const point *there, matrix J, double h,
                           double d_w, double d_s)
{
    const double D_w = h * (there->e_0 - here->e_0 - J.ww * d_w - J.ws * d_s);
    const double D_s = h * (there->e_s - here->e_s - J.sw * d_w - J.ss * d_s);
    const double k = fabs(h);
    const double a = 3 - k * J.ww, b = k * J.ws, c = k * J.sw, d = 3 - k * J.ss;
    const double det = a * d - b * c;
    return (pair){quotient(job, d * D_w + b * D_s, det),
                  quotient(job, c * D_w + a * D_s, det)};
}

/* Book a part of the path; the first one is what it is, the others are added. */
static void book(step *job, int is_first, const part *path)
{
    double lost[LOST] = {0.0}, taken;
    if (!job->has_books)
        return;
    job->law->book(job, path, lost, &taken);
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
    const law *law = job->law;
    const point *here = job->start;
    if (!here) {
        law->evaluate(job, w, s, &job->points[0]);
        here = &job->points[0];
    }
    point *there = &job->points[here == &job->points[0]];
    slopes at_start = law->jacobian(job, here), at_end = at_start;
    for (int n = 0; n < law->most_trials; n++) {
        const matrix J = at_start.J;
        const double f_w = here->e_0, f_s = here->e_s;
        const double z_ww = h * J.ww, z_ws = h * J.ws, z_sw = h * J.sw, z_ss = h * J.ss;
        const pair v = dm_apply_phi_2(job, z_ww, z_ws, z_sw, z_ss, f_w, f_s);
        const double d_w = h * (f_w + z_ww * v.w + z_ws * v.s);
        const double d_s = h * (f_s + z_sw * v.w + z_ss * v.s);
        law->evaluate(job, w + d_w, s + d_s, there);
        double i_w = h * (w + h * v.w), i_s = h * (s + h * v.s);
        const pair c = nonlinear_part(job, here, there, J, h, d_w, d_s);
        const double allowed = job->tolerance + law->relative * (fabs(d_w) + fabs(d_s));
        double error = quotient(job, fabs(c.w) + fabs(c.s), allowed);
        int is_known = 0;
        if (error <= 1.0) {
            law->evaluate(job, w + d_w + c.w, s + d_s + c.s, there);
            if (law->bends(job, here, there)) {
                at_end = law->jacobian(job, there);
                is_known = 1;
                const pair r = nonlinear_part(job, there, here, at_end.J, -h, -d_w - c.w,
                                              -d_s - c.s);
                const double seen = quotient(job, fabs(r.w) + fabs(r.s), BACKWARD * allowed);
                if (seen > error)
                    error = seen;
            }
        }
        if (job->broken)
            return -1;
        if (error <= 1.0) {
            i_w += h * c.w / 4;
            i_s += h * c.s / 4;
            book(job, !booked++, &(part){{w, s}, {f_w, f_s}, at_start, h, {d_w, d_s}, c,
                                         {i_w, i_s}, 0, here, there});
            angle_w += i_w;
            angle_s += i_s;
            w = w + d_w + c.w;
            s = s + d_s + c.s;
            left -= h;
            if (left <= 0.0) {
                job->end = (pair){w, s};
                job->integral = (pair){angle_w, angle_s};
                job->at_end = there;
                return job->broken ? -1 : 0;
            }
            at_start = is_known ? at_end : law->jacobian(job, there);
            here = there;
            there = &job->points[here == &job->points[0]];
        }
        double scale = error > 1e-3 ? SAFETY * pow(error, -1.0 / 3) : GROW;
        scale = scale > SHRINK ? scale : SHRINK;
        h *= scale < GROW ? scale : GROW;
        if (h > 0.999 * left)
            h = left;
    }
    h = left;
    for (int n = 0; n < MOST_RESORTS; n++) {
        pair end, turned;
        const int is_done = law->last_resort(job, (pair){w, s}, at_start.J, h, &end, &turned);
        if (job->broken)
            return -1;
        if (!is_done) {
            h /= 2.0;
            continue;
        }
        law->evaluate(job, end.w, end.s, there);
        const double d_w = end.w - w, d_s = end.s - s;
        const pair f = {quotient(job, d_w, h), quotient(job, d_s, h)};
        book(job, !booked++, &(part){{w, s}, f, at_start, h, {d_w, d_s}, {0.0, 0.0}, turned, 1,
                                     here, there});
        angle_w += turned.w;
        angle_s += turned.s;
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
        there = &job->points[here == &job->points[0]];
        at_start = law->jacobian(job, here);
        h = left < 2.0 * h ? left : 2.0 * h;
    }
    return -1;
}
