/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The adaptive step: see dm_ros/motion/adaptive.py.
 */

#include "exponentials.h"
#include "real.h"

#define EVALUATE job->law->evaluate
#define JACOBIAN job->law->jacobian
#define BENDS job->law->bends
#define APPLY_PHI_2 dm_apply_phi_2

#include "part_equations.h"

enum { MOST_RESORTS = 1000 };

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
    if (!(fabs(here->e_0) + fabs(here->e_s) < FASTEST))
        return -1;
    slopes at_start = law->jacobian(job, here);
    trial found;
    for (int n = 0; n < law->most_trials; n++) {
        try_part(job, here, at_start.J, w, s, h, law->relative, there, &found);
        if (job->broken)
            return -1;
        const double error = found.error;
        if (error <= 1.0) {
            const pair d = found.d, c = found.c, i = {found.integral.w + h * c.w / 4,
                                                      found.integral.s + h * c.s / 4};
            book(job, !booked++, &(part){{w, s}, {here->e_0, here->e_s}, at_start, h, d, c, i, 0,
                                         here, there});
            angle_w += i.w;
            angle_s += i.s;
            w = w + d.w + c.w;
            s = s + d.s + c.s;
            left -= h;
            if (left <= 0.0) {
                job->end = (pair){w, s};
                job->integral = (pair){angle_w, angle_s};
                job->at_end = there;
                return job->broken ? -1 : 0;
            }
            at_start = found.has_slopes ? found.at_end : law->jacobian(job, there);
            here = there;
            there = &job->points[here == &job->points[0]];
        }
        h = next_part(h, error, left);
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
