/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The motion of a differential with clutches: see dm_ros/mechanism/clutched.py.
 */

#include "clutched.h"

/* Solve M = z - W diag(x) |M|; y: the factors where a moment is negative. */
static pair solve_moments(step *job, pair z, const clutched_coefficients *k, pair x, pair y)
{
    double least = 0.0;
    pair best = {0.0, 0.0};
    for (int n = 0; n < 4; n++) {
        const double sign_1 = n & 2 ? -1.0 : 1.0, x_1 = n & 2 ? y.w : x.w;
        const double sign_2 = n & 1 ? -1.0 : 1.0, x_2 = n & 1 ? y.s : x.s;
        const double a = 1 + k->W_11 * x_1 * sign_1, b = k->W_12 * x_2 * sign_2;
        const double c = k->W_21 * x_1 * sign_1, d = 1 + k->W_22 * x_2 * sign_2;
        const double det = a * d - b * c;
        const double M_1 = quotient(job, d * z.w - b * z.s, det);
        const double M_2 = quotient(job, a * z.s - c * z.w, det);
        double wrong = 0.0;
        if (-M_1 * sign_1 > wrong)
            wrong = -M_1 * sign_1;
        if (-M_2 * sign_2 > wrong)
            wrong = -M_2 * sign_2;
        if (n == 0 || wrong < least) {
            least = wrong;
            best = (pair){M_1, M_2};
        }
    }
    return best;
}

static void evaluate(step *job, double w, double s, point *at)
{
    const clutched_coefficients *k = job->coefficients;
    const double *u = job->u;
    const double W_11 = k->W_11, W_12 = k->W_12, W_21 = k->W_21, W_22 = k->W_22;
    const double t_1 = tanh(k->a_1 * s), t_2 = tanh(k->a_2 * s);
    double F_1 = u[S_1] * t_1, F_2 = u[S_2] * t_2;
    const double z_1 = u[M_ONE] + k->P_1w * w + k->P_1s * s - W_11 * F_1 - W_12 * F_2;
    const double z_2 = u[M_TWO] + k->P_2w * w + k->P_2s * s - W_21 * F_1 - W_22 * F_2;
    double x_1 = z_1 >= 0.0 ? k->phi_1 * t_1 : -(k->psi_1 * t_1);
    double x_2 = z_2 >= 0.0 ? k->phi_2 * t_2 : -(k->psi_2 * t_2);
    const double a = 1 + W_11 * x_1, b = W_12 * x_2, c = W_21 * x_1, d = 1 + W_22 * x_2;
    const double det = a * d - b * c;
    double M_1 = quotient(job, d * z_1 - b * z_2, det);
    double M_2 = quotient(job, a * z_2 - c * z_1, det);
    if (M_1 * z_1 < 0.0 || M_2 * z_2 < 0.0) {
        const pair M = solve_moments(
            job, (pair){z_1, z_2}, k, (pair){k->phi_1 * t_1, k->phi_2 * t_2},
            (pair){k->psi_1 * t_1, k->psi_2 * t_2});
        M_1 = M.w;
        M_2 = M.s;
        x_1 = M_1 >= 0.0 ? k->phi_1 * t_1 : -(k->psi_1 * t_1);
        x_2 = M_2 >= 0.0 ? k->phi_2 * t_2 : -(k->psi_2 * t_2);
    }
    F_1 += x_1 * M_1;
    F_2 += x_2 * M_2;
    at->e_0 = u[B_W] + k->A_ww * w + k->A_ws * s - k->C_w1 * F_1 - k->C_w2 * F_2;
    at->e_s = u[B_S] + k->A_sw * w + k->A_ss * s - k->C_s1 * F_1 - k->C_s2 * F_2;
    at->F_1 = F_1;
    at->F_2 = F_2;
    at->M_1 = M_1;
    at->M_2 = M_2;
    at->state[0] = t_1;
    at->state[1] = t_2;
    at->state[2] = x_1;
    at->state[3] = x_2;
}

static slopes jacobian(step *job, const point *at)
{
    const clutched_coefficients *k = job->coefficients;
    const double M_1 = at->M_1, M_2 = at->M_2;
    const double t_1 = at->state[0], t_2 = at->state[1], x_1 = at->state[2], x_2 = at->state[3];
    const double phi_1 = M_1 >= 0.0 ? k->phi_1 : k->psi_1;
    const double phi_2 = M_2 >= 0.0 ? k->phi_2 : k->psi_2;
    const double N_1 = (phi_1 * fabs(M_1) + job->u[S_1]) * k->a_1 * (1 - t_1 * t_1);
    const double N_2 = (phi_2 * fabs(M_2) + job->u[S_2]) * k->a_2 * (1 - t_2 * t_2);
    const double a = 1 + x_1 * k->W_11, b = x_1 * k->W_12, c = x_2 * k->W_21;
    const double d = 1 + x_2 * k->W_22;
    const double det = a * d - b * c;
    double r_1 = x_1 * k->P_1w, r_2 = x_2 * k->P_2w;
    const double F_1w = quotient(job, d * r_1 - b * r_2, det);
    const double F_2w = quotient(job, a * r_2 - c * r_1, det);
    r_1 = x_1 * k->P_1s + N_1;
    r_2 = x_2 * k->P_2s + N_2;
    const double F_1s = quotient(job, d * r_1 - b * r_2, det);
    const double F_2s = quotient(job, a * r_2 - c * r_1, det);
    return (slopes){{k->A_ww - k->C_w1 * F_1w - k->C_w2 * F_2w,
                     k->A_ws - k->C_w1 * F_1s - k->C_w2 * F_2s,
                     k->A_sw - k->C_s1 * F_1w - k->C_s2 * F_2w,
                     k->A_ss - k->C_s1 * F_1s - k->C_s2 * F_2s}, {F_1w, F_1s, F_2w, F_2s}};
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
    u[B_W] = k->B_w0 * T[0] + k->B_w1 * T[1] + k->B_w2 * T[2];
    u[B_S] = k->B_s0 * T[0] + k->B_s1 * T[1] + k->B_s2 * T[2];
    u[M_ONE] = k->Q_10 * T[0] + k->Q_11 * T[1] + k->Q_12 * T[2];
    u[M_TWO] = k->Q_20 * T[0] + k->Q_21 * T[1] + k->Q_22 * T[2];
    u[S_1] = S[0];
    u[S_2] = S[1];
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
    evaluate(f->job, f->w_0, slip, &at);
    return f->w_0 + f->slip * at.e_0;
}

static double slip_residual(const context *f, double slip)
{
    point at;
    evaluate(f->job, carrier(f, slip), slip, &at);
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
    200, 1e-6, evaluate, jacobian, torque_slopes, always, backward_euler, dm_clutched_book,
};
const law dm_clutched_symmetric = {
    200, 1e-6, evaluate, jacobian, torque_slopes, always, backward_euler,
    dm_clutched_symmetric_book,
};
