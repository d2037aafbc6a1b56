/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The equations of the passive law: see dm_ros/mechanism/passive.py.
 */

#include <string.h>

#include "passive.h"

static const double STRAIGHT = 0.02, TINY = 1e-280;
enum { ROUNDS = 8 };

/* Return the pattern of signs of a number, its last five digits by two. */
static signs pattern_of(int n)
{
    return (signs){n & 16 ? -1.0 : 1.0, n & 8 ? -1.0 : 1.0, n & 4 ? -1.0 : 1.0,
                   n & 2 ? 0.0 : 1.0, n & 1 ? 0.0 : 1.0};
}

/*
 * Solve the equations at given signs, in the state of the result; return by how much the solution
 * disagrees with them.
 */
static double solve(step *job, double q_1, double q_2, signs sign, signs *found, point *result)
{
    const coefficients *k = job->coefficients;
    const double T_in = job->u[T_IN], S_1 = job->u[S_ONE], S_2 = job->u[S_TWO];
    const double *state = result->state;
    const double w = state[0], s = state[1], sigma_0 = state[2], sigma_1 = state[3];
    const double sigma_2 = state[4], t_1 = state[5], t_2 = state[6];
    const double s_1 = sign.s_1, s_2 = sign.s_2, s_F = sign.s_F, h_N = sign.h_N, b = sign.b;
    const double h_1 = k->half_1 * sigma_1 * s_1, h_2 = k->half_2 * sigma_2 * s_2;
    const double x_1 = s_1 > 0.0 ? k->phi_1 * t_1 * s_1 : k->psi_1 * t_1 * s_1;
    const double x_2 = s_2 > 0.0 ? k->phi_2 * t_2 * s_2 : k->psi_2 * t_2 * s_2;
    const double n_1 = k->mean_1 + h_1, n_2 = k->mean_2 + h_2;
    const double p_1 = k->mean_1 - h_1 - x_1, p_2 = k->mean_2 - h_2 - x_2;
    const double m_1 = quotient(job, k->I_1, p_1), m_2 = quotient(job, k->I_2, p_2);
    const double r_1 = quotient(job, q_1, p_1), r_2 = quotient(job, q_2, p_2);
    const double F_1 = S_1 * t_1, F_2 = S_2 * t_2;
    const double X = k->l_0 * w - (k->l_1 * k->k_1 - k->l_2 * k->k_2) * s - F_1 - F_2;
    const double beta_0 = k->bearing_0 * fabs(sigma_0);
    const double beta = beta_0 * b;
    const double a_N = 1 + beta * h_N, a_X = 1 + beta;
    const double y_1 = a_N * n_1 - a_X * x_1, y_2 = a_N * n_2 - a_X * x_2;
    double c_F, per_torque, T_3, inertia, drive;

    if (k->g_F != 0.0) {
        const double h = k->half_F * sigma_0 * s_F;
        const double n_F = k->mean_F + h;
        const double beta_3 = k->bearing_3 * fabs(sigma_0);
        const int drives = w * s_F > 0.0;
        const double a_P = drives ? 1 + beta_3 : 1.0, a_C = drives ? 1.0 : a_X;
        c_F = k->mean_F - h;
        T_3 = T_in * k->g_F * w < 0.0 ? T_in * (1 + beta_3) : T_in;
        T_3 -= (1 + beta_3) * k->l_3 * k->g_F * w;
        per_torque = quotient(job, k->g_F, a_P * n_F);
        const double C = a_C * c_F * per_torque;
        inertia = k->I_0 + C * k->I_3 * k->g_F;
        drive = C * T_3;
    } else {
        c_F = per_torque = T_3 = 0.0;
        inertia = k->I_0;
        drive = T_in * w < 0.0 ? a_X * T_in : T_in;
    }
    const double z_1 = k->g_12 * n_1, z_2 = n_2;
    const double G_11 = inertia + y_1 * m_1 + y_2 * m_2;
    const double G_12 = y_1 * m_1 * k->k_1 - y_2 * m_2 * k->k_2;
    const double G_21 = z_1 * m_1 - z_2 * m_2;
    const double G_22 = z_1 * m_1 * k->k_1 + z_2 * m_2 * k->k_2 + k->I_s;
    const double R_1 = drive - a_X * X - y_1 * r_1 - y_2 * r_2;
    const double R_2 = z_2 * r_2 - z_1 * r_1 - k->l_s * s;
    const double det = G_11 * G_22 - G_12 * G_21;
    const double e_0 = quotient(job, R_1 * G_22 - R_2 * G_12, det);
    const double e_s = quotient(job, G_11 * R_2 - G_21 * R_1, det);
    const double M_1 = m_1 * (e_0 + k->k_1 * e_s) + r_1;
    const double M_2 = m_2 * (e_0 - k->k_2 * e_s) + r_2;
    const double M_F = per_torque * (T_3 - k->I_3 * k->g_F * e_0);

    double N = n_1 * M_1 + n_2 * M_2, C = k->g_F != 0.0 ? c_F * M_F : T_in;
    const double F_1x = x_1 * M_1, F_2x = x_2 * M_2;
    double bracket = X - F_1x - F_2x;
    if (w < 0.0) {
        bracket = -bracket;
        N = -N;
        C = -C;
    }
    if (N > 0.0)
        bracket += N;
    if (C < 0.0)
        bracket -= C;
    if (w == 0.0)
        N = 0.0;
    result->e_0 = e_0;
    result->e_s = e_s;
    result->F_1 = F_1 + F_1x;
    result->F_2 = F_2 + F_2x;
    result->M_1 = M_1;
    result->M_2 = M_2;
    result->M_F = M_F;
    result->sign = sign;
    double *v = result->solved;
    v[0] = n_1, v[1] = n_2, v[2] = p_1, v[3] = p_2, v[4] = m_1, v[5] = m_2, v[6] = y_1;
    v[7] = y_2, v[8] = X, v[9] = a_N, v[10] = a_X, v[11] = inertia, v[12] = G_11, v[13] = G_12;
    v[14] = G_21, v[15] = G_22, v[16] = det;
    if (M_1 * s_1 >= 0.0 && M_2 * s_2 >= 0.0 && M_F * s_F >= 0.0
        && (h_N != 0.0 ? N >= 0.0 : N <= 0.0) && (b != 0.0 ? bracket >= 0.0 : bracket <= 0.0)) {
        *found = sign;
        return 0.0;
    }
    *found = (signs){M_1 >= 0.0 ? 1.0 : -1.0, M_2 >= 0.0 ? 1.0 : -1.0, M_F >= 0.0 ? 1.0 : -1.0,
                     N > 0.0 ? 1.0 : 0.0, bracket > 0.0 ? 1.0 : 0.0};
    const double others[] = {-M_2 * s_2, -M_F * s_F, h_N != 0.0 ? -N : N,
                             b != 0.0 ? -bracket : bracket};
    double wrong = -M_1 * s_1;
    for (int n = 0; n < 4; n++)
        if (others[n] > wrong)
            wrong = others[n];
    return wrong;
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

/* Put w, s and the tanh of each sign into state, or what is known of the same speeds. */
static void find_state(step *job, double w, double s, double *state)
{
    const coefficients *k = job->coefficients;
    const double speeds[2] = {w, s}, k_1s = k->k_1 * s, k_2s = k->k_2 * s;
    if (job->seen && !memcmp(job->seen, speeds, sizeof speeds)) {
        if (state != job->seen)
            memcpy(state, job->seen, STATE * sizeof *state);
        return;
    }
    state[0] = w;
    state[1] = s;
    state[2] = tanh(quotient(job, w, k->sign_speed));
    state[3] = tanh(quotient(job, w + k_1s, k->sign_speed));
    state[4] = tanh(quotient(job, w - k_2s, k->sign_speed));
    state[5] = tanh(k->a_1 * s);
    state[6] = tanh(k->a_2 * s);
}

static void evaluate(step *job, double w, double s, point *at)
{
    const coefficients *k = job->coefficients;
    const double *u = job->u;
    const double k_1s = k->k_1 * s, k_2s = k->k_2 * s;
    find_state(job, w, s, at->state);
    const double t_1 = at->state[5], t_2 = at->state[6];
    const double q_1 = u[S_ONE] * t_1 + k->l_1 * k_1s - u[T_ONE];
    const double q_2 = u[S_TWO] * t_2 - k->l_2 * k_2s - u[T_TWO];
    const double both = q_1 + q_2;
    signs sign = {q_1 >= 0.0 ? 1.0 : -1.0, q_2 >= 0.0 ? 1.0 : -1.0, both >= 0.0 ? 1.0 : -1.0,
                  both * w > 0.0 ? 1.0 : 0.0, 1.0}, found;
    for (int n = 0; n < ROUNDS; n++) {
        if (solve(job, q_1, q_2, sign, &found, at) == 0.0)
            return;
        sign = found;
    }
    point best = *at;
    double least = 0.0;
    for (int n = 0; n < 32; n++) {
        const double wrong = solve(job, q_1, q_2, pattern_of(n), &found, at);
        if (n == 0 || wrong < least) {
            least = wrong;
            best = *at;
        }
    }
    *at = best;
}

static slopes jacobian(step *job, const point *at)
{
    const coefficients *k = job->coefficients;
    const double T_in = job->u[T_IN], S_1 = job->u[S_ONE], S_2 = job->u[S_TWO];
    const double M_1 = at->M_1, M_2 = at->M_2, M_F = at->M_F;
    const double s_1 = at->sign.s_1, s_2 = at->sign.s_2, s_F = at->sign.s_F;
    const double h_N = at->sign.h_N, b = at->sign.b;
    const double w = at->state[0], sigma_0 = at->state[2], sigma_1 = at->state[3];
    const double sigma_2 = at->state[4], t_1 = at->state[5], t_2 = at->state[6];
    const double *v = at->solved;
    const double n_1 = v[0], n_2 = v[1], p_1 = v[2], p_2 = v[3], y_1 = v[6], y_2 = v[7];
    const double X = v[8], a_N = v[9], a_X = v[10], G_11 = v[12], G_12 = v[13], G_21 = v[14];
    const double G_22 = v[15], det = v[16];
    const double n_1w = quotient(job, k->half_1 * s_1 * (1 - sigma_1 * sigma_1), k->sign_speed);
    const double n_2w = quotient(job, k->half_2 * s_2 * (1 - sigma_2 * sigma_2), k->sign_speed);
    const double n_1s = n_1w * k->k_1, n_2s = -n_2w * k->k_2;
    const double u_1 = k->a_1 * (1 - t_1 * t_1), u_2 = k->a_2 * (1 - t_2 * t_2);
    const double phi_1 = s_1 > 0.0 ? k->phi_1 : k->psi_1, phi_2 = s_2 > 0.0 ? k->phi_2 : k->psi_2;
    const double x_1s = phi_1 * s_1 * u_1, x_2s = phi_2 * s_2 * u_2;
    const double q_1s = k->l_1 * k->k_1 + S_1 * u_1, q_2s = S_2 * u_2 - k->l_2 * k->k_2;
    const double M_1w = quotient(job, M_1 * n_1w, p_1);
    const double M_1s = quotient(job, q_1s + M_1 * (n_1s + x_1s), p_1);
    const double M_2w = quotient(job, M_2 * n_2w, p_2);
    const double M_2s = quotient(job, q_2s + M_2 * (n_2s + x_2s), p_2);
    double g_w = (M_1 * a_N * n_1w + y_1 * M_1w + M_2 * a_N * n_2w + y_2 * M_2w + a_X * k->l_0);
    const double g_s = (M_1 * (a_N * n_1s - a_X * x_1s) + y_1 * M_1s
                        + M_2 * (a_N * n_2s - a_X * x_2s) + y_2 * M_2s - a_X * (q_1s + q_2s));
    const double sigma_w = quotient(job, 1 - sigma_0 * sigma_0, k->sign_speed);
    if (k->g_F != 0.0 || sigma_w != 0.0) {
        const double side = w < 0.0 ? -1.0 : 1.0;
        const double beta_w = k->bearing_0 * side * sigma_w * b;
        const double N = n_1 * M_1 + n_2 * M_2;
        const double x_M = phi_1 * t_1 * s_1 * M_1 + phi_2 * t_2 * s_2 * M_2;
        g_w += beta_w * (h_N * N + X - x_M);
        if (k->g_F != 0.0) {
            const double h = k->half_F * sigma_0 * s_F;
            const double n_F = k->mean_F + h, c_F = k->mean_F - h;
            const double n_Fw = k->half_F * s_F * sigma_w;
            const double beta_3 = k->bearing_3 * fabs(sigma_0);
            const double beta_3w = k->bearing_3 * side * sigma_w;
            const int drives = w * s_F > 0.0;
            const double a_P = drives ? 1 + beta_3 : 1.0, a_Pw = drives ? beta_3w : 0.0;
            const double a_C = drives ? 1.0 : a_X, a_Cw = drives ? 0.0 : beta_w;
            double T_3w = -k->l_3 * k->g_F * (1 + beta_3 + beta_3w * w);
            if (T_in * k->g_F * w < 0.0)
                T_3w += T_in * beta_3w;
            const double M_Fw = (quotient(job, k->g_F, a_P * n_F) * T_3w
                                 - M_F * (quotient(job, a_Pw, a_P) + quotient(job, n_Fw, n_F)));
            g_w -= a_Cw * c_F * M_F + a_C * (c_F * M_Fw - n_Fw * M_F);
        } else if (T_in * w < 0.0) {
            g_w -= beta_w * T_in;
        }
    }
    const double r_w = k->g_12 * (n_1w * M_1 + n_1 * M_1w) - n_2w * M_2 - n_2 * M_2w;
    const double r_s = k->g_12 * (n_1s * M_1 + n_1 * M_1s) - n_2s * M_2 - n_2 * M_2s + k->l_s;
    return (slopes){{quotient(job, G_12 * r_w - G_22 * g_w, det),
                     quotient(job, G_12 * r_s - G_22 * g_s, det),
                     quotient(job, G_21 * g_w - G_11 * r_w, det),
                     quotient(job, G_21 * g_s - G_11 * r_s, det)}, {0.0}};
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
    const coefficients *k = job->coefficients;
    const signs *a = &here->sign, *b = &there->sign;
    if (a->s_1 != b->s_1 || a->s_2 != b->s_2 || a->s_F != b->s_F || a->h_N != b->h_N
        || a->b != b->b)
        return 1;
    for (int n = 2; n < STATE; n++) {
        const double change = there->state[n] - here->state[n];
        if (!(-STRAIGHT < change && change < STRAIGHT))
            return 1;
    }
    const double v_w = here->e_0, v_s = here->e_s, w_w = there->e_0, w_s = there->e_s;
    return !(v_w * w_w >= 0.0 && v_s * w_s >= 0.0
             && (v_w + k->k_1 * v_s) * (w_w + k->k_1 * w_s) >= 0.0
             && (v_w - k->k_2 * v_s) * (w_w - k->k_2 * w_s) >= 0.0);
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
