/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The equations of the paper's law with clutches, made of REAL: see dm_ros/mechanism/clutched.py
 * and real.h.
 */

/* Solve M = z - W diag(x) |M|; y: the factors where a moment is negative. */
static OF(pair) solve_moments(OF(step) *job, OF(pair) z, const OF(clutched_coefficients) *k,
                              OF(pair) x, OF(pair) y)
{
    REAL least = fill(0.0);
    OF(pair) best = {fill(0.0), fill(0.0)};
    for (int n = 0; n < 4; n++) {
        const REAL sign_1 = fill(n & 2 ? -1.0 : 1.0), x_1 = n & 2 ? y.w : x.w;
        const REAL sign_2 = fill(n & 1 ? -1.0 : 1.0), x_2 = n & 1 ? y.s : x.s;
        const REAL a = 1 + k->W_11 * x_1 * sign_1, b = k->W_12 * x_2 * sign_2;
        const REAL c = k->W_21 * x_1 * sign_1, d = 1 + k->W_22 * x_2 * sign_2;
        const REAL det = a * d - b * c;
        const REAL M_1 = OF(quotient)(job, d * z.w - b * z.s, det);
        const REAL M_2 = OF(quotient)(job, a * z.s - c * z.w, det);
        REAL wrong = fill(0.0);
        wrong = pick(-M_1 * sign_1 > wrong, -M_1 * sign_1, wrong);
        wrong = pick(-M_2 * sign_2 > wrong, -M_2 * sign_2, wrong);
        MASK is_better = wrong < least;
        if (n == 0)
            is_better = opposite(no_mask());
        least = pick(is_better, wrong, least);
        best.w = pick(is_better, M_1, best.w);
        best.s = pick(is_better, M_2, best.s);
    }
    return best;
}

static void evaluate_clutched(OF(step) *job, REAL w, REAL s, OF(point) *at)
{
    const OF(clutched_coefficients) *k = job->coefficients;
    const REAL *u = job->u;
    const REAL W_11 = k->W_11, W_12 = k->W_12, W_21 = k->W_21, W_22 = k->W_22;
    const REAL t_1 = tanh_of(k->a_1 * s), t_2 = tanh_of(k->a_2 * s);
    REAL F_1 = u[S_1] * t_1, F_2 = u[S_2] * t_2;
    const REAL z_1 = u[M_ONE] + k->P_1w * w + k->P_1s * s - W_11 * F_1 - W_12 * F_2;
    const REAL z_2 = u[M_TWO] + k->P_2w * w + k->P_2s * s - W_21 * F_1 - W_22 * F_2;
    REAL x_1 = pick(z_1 >= 0.0, k->phi_1 * t_1, -(k->psi_1 * t_1));
    REAL x_2 = pick(z_2 >= 0.0, k->phi_2 * t_2, -(k->psi_2 * t_2));
    const REAL a = 1 + W_11 * x_1, b = W_12 * x_2, c = W_21 * x_1, d = 1 + W_22 * x_2;
    const REAL det = a * d - b * c;
    REAL M_1 = OF(quotient)(job, d * z_1 - b * z_2, det);
    REAL M_2 = OF(quotient)(job, a * z_2 - c * z_1, det);
    const MASK turns = ((M_1 * z_1 < 0.0) | (M_2 * z_2 < 0.0)) & OF(watched)(job);
    if (any(turns)) {
        const MASK before = OF(watch)(job, turns);
        const OF(pair) M = solve_moments(
            job, (OF(pair)){z_1, z_2}, k, (OF(pair)){k->phi_1 * t_1, k->phi_2 * t_2},
            (OF(pair)){k->psi_1 * t_1, k->psi_2 * t_2});
        OF(watch)(job, before);
        M_1 = pick(turns, M.w, M_1);
        M_2 = pick(turns, M.s, M_2);
        x_1 = pick(turns, pick(M_1 >= 0.0, k->phi_1 * t_1, -(k->psi_1 * t_1)), x_1);
        x_2 = pick(turns, pick(M_2 >= 0.0, k->phi_2 * t_2, -(k->psi_2 * t_2)), x_2);
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

/* Return the Jacobian of the motion; put that of the friction, 1w, 1s, 2w, 2s, into F. */
static OF(matrix) jacobian_clutched(OF(step) *job, const OF(point) *at, REAL *F)
{
    const OF(clutched_coefficients) *k = job->coefficients;
    const REAL M_1 = at->M_1, M_2 = at->M_2;
    const REAL t_1 = at->state[0], t_2 = at->state[1], x_1 = at->state[2], x_2 = at->state[3];
    const REAL phi_1 = pick(M_1 >= 0.0, k->phi_1, k->psi_1);
    const REAL phi_2 = pick(M_2 >= 0.0, k->phi_2, k->psi_2);
    const REAL N_1 = (phi_1 * absolute(M_1) + job->u[S_1]) * k->a_1 * (1 - t_1 * t_1);
    const REAL N_2 = (phi_2 * absolute(M_2) + job->u[S_2]) * k->a_2 * (1 - t_2 * t_2);
    const REAL a = 1 + x_1 * k->W_11, b = x_1 * k->W_12, c = x_2 * k->W_21;
    const REAL d = 1 + x_2 * k->W_22;
    const REAL det = a * d - b * c;
    REAL r_1 = x_1 * k->P_1w, r_2 = x_2 * k->P_2w;
    F[0] = OF(quotient)(job, d * r_1 - b * r_2, det);
    F[2] = OF(quotient)(job, a * r_2 - c * r_1, det);
    r_1 = x_1 * k->P_1s + N_1;
    r_2 = x_2 * k->P_2s + N_2;
    F[1] = OF(quotient)(job, d * r_1 - b * r_2, det);
    F[3] = OF(quotient)(job, a * r_2 - c * r_1, det);
    return (OF(matrix)){k->A_ww - k->C_w1 * F[0] - k->C_w2 * F[2],
                        k->A_ws - k->C_w1 * F[1] - k->C_w2 * F[3],
                        k->A_sw - k->C_s1 * F[0] - k->C_s2 * F[2],
                        k->A_ss - k->C_s1 * F[1] - k->C_s2 * F[3]};
}

/* Put what is held in a step, under torques and friction, into u. */
static void hold(const OF(clutched_coefficients) *k, const REAL *T, const REAL *S, REAL *u)
{
    u[B_W] = k->B_w0 * T[0] + k->B_w1 * T[1] + k->B_w2 * T[2];
    u[B_S] = k->B_s0 * T[0] + k->B_s1 * T[1] + k->B_s2 * T[2];
    u[M_ONE] = k->Q_10 * T[0] + k->Q_11 * T[1] + k->Q_12 * T[2];
    u[M_TWO] = k->Q_20 * T[0] + k->Q_21 * T[1] + k->Q_22 * T[2];
    u[S_1] = S[0];
    u[S_2] = S[1];
}
