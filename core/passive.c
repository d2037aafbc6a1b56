/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The equations of the passive law: see dm_ros/mechanism/passive.py.
 */

#include <string.h>

#include "passive.h"

#include "real.h"

#include "passive_equations.h"

static const double TINY = 1e-280;

/* Return the pattern of signs of a number, its last five digits by two. */
static signs pattern_of(int n)
{
    return (signs){n & 16 ? -1.0 : 1.0, n & 8 ? -1.0 : 1.0, n & 4 ? -1.0 : 1.0,
                   n & 2 ? 0.0 : 1.0, n & 1 ? 0.0 : 1.0};
}

int dm_has_solutions(const coefficients *k)
{
    step job = {.coefficients = k, .u = {1.0, 1.0, 1.0, 0.0, 0.0}};
    for (int n = 0; n < 64; n++) {
        const double turned = n & 32 ? -1.0 : 1.0;
        const signs sign = pattern_of(n);
        signs found;
        point at = {.state = {1.0, turned, 1.0, 1.0, 1.0, turned, -turned}};
        solve(&job, -1.0, -1.0, sign, &found, &at);
        const double sum = at.e_0 + at.e_s + at.F_1 + at.F_2 + at.M_1 + at.M_2 + at.M_F;
        if (job.broken || !(at.solved[SOLVED - 1] > TINY) || !isfinite(sum))
            return 0;
    }
    return 1;
}

/* Put w, s and their signs into state, or what is known of the same speeds. */
static void find_state(step *job, double w, double s, double *state)
{
    const double speeds[2] = {w, s};
    if (job->seen && !memcmp(job->seen, speeds, sizeof speeds)) {
        if (state != job->seen)
            memcpy(state, job->seen, STATE * sizeof *state);
        return;
    }
    state[0] = w;
    state[1] = s;
    find_signs(job, w, s, state);
}

static void evaluate(step *job, double w, double s, point *at)
{
    double q[2];
    signs found;
    find_state(job, w, s, at->state);
    signs sign = first_guess(job, at->state, q);
    for (int n = 0; n < ROUNDS; n++) {
        if (solve(job, q[0], q[1], sign, &found, at) == 0.0)
            return;
        sign = found;
    }
    point best = *at;
    double least = 0.0;
    for (int n = 0; n < 32; n++) {
        const double wrong = solve(job, q[0], q[1], pattern_of(n), &found, at);
        if (n == 0 || wrong < least) {
            least = wrong;
            best = *at;
        }
    }
    *at = best;
}

static slopes jacobian(step *job, const point *at)
{
    return (slopes){jacobian_at(job, at), {0.0}};
}

static void torque_slopes(step *job, const point *at, double *of_w, double *of_s)
{
    const coefficients *k = job->coefficients;
    const double T_in = job->u[T_IN], s_F = at->sign.s_F;
    const double w = at->state[0], sigma_0 = at->state[2];
    const double *v = at->solved;
    const double n_1 = v[0], n_2 = v[1], p_1 = v[2], p_2 = v[3], y_1 = v[6], y_2 = v[7];
    const double a_X = v[10], G_11 = v[12], G_12 = v[13], G_21 = v[14], G_22 = v[15];
    const double det = v[16];
    double drive = T_in * w < 0.0 ? a_X : 1.0;
    if (k->g_F != 0.0) {
        const double h = k->half_F * sigma_0 * s_F, beta_3 = k->bearing_3 * fabs(sigma_0);
        const int drives = w * s_F > 0.0;
        const double a_P = drives ? 1 + beta_3 : 1.0, a_C = drives ? 1.0 : a_X;
        drive = quotient(job, a_C * (k->mean_F - h) * k->g_F, a_P * (k->mean_F + h));
        if (T_in * k->g_F * w < 0.0)
            drive *= 1 + beta_3;
    }
    const double R[3][2] = {
        {drive, 0.0},
        {quotient(job, y_1, p_1), quotient(job, k->g_12 * n_1, p_1)},
        {quotient(job, y_2, p_2), quotient(job, -n_2, p_2)}};
    for (int n = 0; n < 3; n++) {
        of_w[n] = quotient(job, R[n][0] * G_22 - R[n][1] * G_12, det);
        of_s[n] = quotient(job, G_11 * R[n][1] - G_21 * R[n][0], det);
    }
}

static int bends(const step *job, const point *here, const point *there)
{
    return bends_between(job, here, there);
}

void dm_lost_powers(const step *job, const point *at, double *lost)
{
    const coefficients *k = job->coefficients;
    const double T_in = job->u[T_IN], F_1 = at->F_1, F_2 = at->F_2;
    const double M_1 = at->M_1, M_2 = at->M_2, M_F = at->M_F;
    const double h_N = at->sign.h_N, b = at->sign.b;
    const double w = at->state[0], s = at->state[1], sigma_0 = at->state[2];
    const double sigma_1 = at->state[3], sigma_2 = at->state[4];
    const double k_1s = k->k_1 * s, k_2s = k->k_2 * s;
    const double N = ((k->mean_1 * M_1 + k->half_1 * fabs(M_1) * sigma_1)
                      + (k->mean_2 * M_2 + k->half_2 * fabs(M_2) * sigma_2));
    const double w_3 = k->g_F * w;
    double mesh_F = 0.0, bearing_3 = 0.0, C = T_in;
    if (k->g_F != 0.0) {
        C = k->mean_F * M_F - k->half_F * fabs(M_F) * sigma_0;
        const double P_w3 = (k->mean_F * M_F + k->half_F * fabs(M_F) * sigma_0) * w;
        const double T_w3 = T_in * w_3;
        mesh_F = 2 * k->half_F * fabs(M_F) * sigma_0 * w;
        bearing_3 = k->bearing_3 * fabs(sigma_0) * (
            k->l_3 * w_3 * w_3 + (P_w3 > 0.0 ? P_w3 : 0.0) - (T_w3 < 0.0 ? T_w3 : 0.0));
    }
    const double X = k->l_0 * w - k->l_1 * k_1s + k->l_2 * k_2s - F_1 - F_2;
    const double load = X * w + h_N * N * w - (C * w < 0.0 ? C * w : 0.0);
    const double bearing_0 = k->bearing_0 * fabs(sigma_0) * b * (load > 0.0 ? load : 0.0);
    lost[0] = (k->l_0 * w * w + k->l_3 * w_3 * w_3 + k->l_1 * k_1s * k_1s
               + k->l_2 * k_2s * k_2s + k->l_s * k->k_2 * s * s);
    lost[1] = mesh_F;
    lost[2] = 2 * k->half_1 * fabs(M_1) * sigma_1 * (w + k_1s);
    lost[3] = 2 * k->half_2 * fabs(M_2) * sigma_2 * (w - k_2s);
    lost[4] = bearing_3;
    lost[5] = bearing_0;
    lost[6] = F_1 * k_1s;
    lost[7] = -F_2 * k_2s;
}

const law dm_passive = {
    400, 1e-12, evaluate, jacobian, torque_slopes, bends, dm_implicit_euler, dm_passive_book,
};
