/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The motion of a differential with clutches: see dm_ros/mechanism/clutched.py.
 */

#include "clutched.h"

#include "real.h"

#include "clutched_equations.h"

static slopes jacobian(step *job, const point *at)
{
    slopes found;
    found.J = jacobian_clutched(job, at, found.F);
    return found;
}

static void torque_slopes(step *job, const point *at, double *of_w, double *of_s)
{
    const clutched_coefficients *k = job->coefficients;
    const double x_1 = at->state[2], x_2 = at->state[3];
    const double a = 1 + x_1 * k->W_11, b = x_1 * k->W_12, c = x_2 * k->W_21;
    const double d = 1 + x_2 * k->W_22;
    const double det = a * d - b * c;
    const double of_port[3][4] = {{k->B_w0, k->B_s0, k->Q_10, k->Q_20},
                                  {k->B_w1, k->B_s1, k->Q_11, k->Q_21},
                                  {k->B_w2, k->B_s2, k->Q_12, k->Q_22}};
    for (int n = 0; n < 3; n++) {
        const double Q_1 = of_port[n][2], Q_2 = of_port[n][3];
        const double F_1 = quotient(job, d * x_1 * Q_1 - b * x_2 * Q_2, det);
        const double F_2 = quotient(job, a * x_2 * Q_2 - c * x_1 * Q_1, det);
        of_w[n] = of_port[n][0] - k->C_w1 * F_1 - k->C_w2 * F_2;
        of_s[n] = of_port[n][1] - k->C_s1 * F_1 - k->C_s2 * F_2;
    }
}

void dm_clutched_held(const clutched_coefficients *k, const double *T, const double *S, double *u)
{
    hold(k, T, S, u);
}

static int always(const step *job, const point *here, const point *there)
{
    (void)job;
    (void)here;
    (void)there;
    return 1;
}

/* Of a context: w_0 is the carrier speed at the start, slip what its slope is taken times. */
static double carrier(const context *f, double slip)
{
    point at;
    evaluate_clutched(f->job, f->w_0, slip, &at);
    return f->w_0 + f->slip * at.e_0;
}

static double slip_residual(const context *f, double slip)
{
    point at;
    evaluate_clutched(f->job, carrier(f, slip), slip, &at);
    return slip - f->s_0 - f->h * at.e_s;
}

static int backward_euler(step *job, pair y, matrix J, double h, pair *end, pair *integral)
{
    const double slope = 1.0 - h * J.ww;
    const context f = {job, slip_residual, y.w, y.s, h, h / (slope > 1.0 ? slope : 1.0)};
    double slip;
    if (!dm_root(&f, y.s, &slip))
        slip = y.s;   /* no number in reach fits: the clutch holds */
    *end = (pair){carrier(&f, slip), slip};
    *integral = (pair){h * (y.w + end->w) / 2, h * (y.s + slip) / 2};
    return 1;
}

const law dm_clutched = {
    200, 1e-6, evaluate_clutched, jacobian, torque_slopes, always, backward_euler,
    dm_clutched_book,
};
const law dm_clutched_symmetric = {
    200, 1e-6, evaluate_clutched, jacobian, torque_slopes, always, backward_euler,
    dm_clutched_symmetric_book,
};
