/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The equations of the passive law, made of REAL: see dm_ros/mechanism/passive.py and real.h.
 */

static const double STRAIGHT = 0.02;
enum { ROUNDS = 8 };

/*
 * Solve the equations at given signs, in the state of the result; return by how much the solution
 * disagrees with them.
 */
static REAL solve(OF(step) *job, REAL q_1, REAL q_2, OF(signs) sign, OF(signs) *found,
                  OF(point) *result)
{
    const OF(coefficients) *k = job->coefficients;
    const REAL T_in = job->u[T_IN], S_1 = job->u[S_ONE], S_2 = job->u[S_TWO];
    const REAL *state = result->state;
    const REAL w = state[0], s = state[1], sigma_0 = state[2], sigma_1 = state[3];
    const REAL sigma_2 = state[4], t_1 = state[5], t_2 = state[6];
    const REAL s_1 = sign.s_1, s_2 = sign.s_2, s_F = sign.s_F, h_N = sign.h_N, b = sign.b;
    const REAL one = fill(1.0), none = fill(0.0);
    const REAL h_1 = k->half_1 * sigma_1 * s_1, h_2 = k->half_2 * sigma_2 * s_2;
    const REAL x_1 = pick(s_1 > 0.0, k->phi_1, k->psi_1) * t_1 * s_1;
    const REAL x_2 = pick(s_2 > 0.0, k->phi_2, k->psi_2) * t_2 * s_2;
    const REAL n_1 = k->mean_1 + h_1, n_2 = k->mean_2 + h_2;
    const REAL p_1 = k->mean_1 - h_1 - x_1, p_2 = k->mean_2 - h_2 - x_2;
    const REAL m_1 = OF(quotient)(job, k->I_1, p_1), m_2 = OF(quotient)(job, k->I_2, p_2);
    const REAL r_1 = OF(quotient)(job, q_1, p_1), r_2 = OF(quotient)(job, q_2, p_2);
    const REAL F_1 = S_1 * t_1, F_2 = S_2 * t_2;
    const REAL X = k->l_0 * w - (k->l_1 * k->k_1 - k->l_2 * k->k_2) * s - F_1 - F_2;
    const REAL beta_0 = k->bearing_0 * absolute(sigma_0);
    const REAL beta = beta_0 * b;
    const REAL a_N = 1 + beta * h_N, a_X = 1 + beta;
    const REAL y_1 = a_N * n_1 - a_X * x_1, y_2 = a_N * n_2 - a_X * x_2;
    const MASK has_drive = k->g_F != 0.0;
    REAL c_F, per_torque, T_3, inertia, drive;

    if (any(has_drive)) {
        const REAL h = k->half_F * sigma_0 * s_F;
        const REAL n_F = k->mean_F + h;
        const REAL beta_3 = k->bearing_3 * absolute(sigma_0);
        const MASK drives = w * s_F > 0.0;
        const REAL a_P = pick(drives, 1 + beta_3, one), a_C = pick(drives, one, a_X);
        c_F = k->mean_F - h;
        T_3 = pick(T_in * k->g_F * w < 0.0, T_in * (1 + beta_3), T_in);
        T_3 -= (1 + beta_3) * k->l_3 * k->g_F * w;
        per_torque = OF(quotient)(job, k->g_F, a_P * n_F);
        const REAL C = a_C * c_F * per_torque;
        inertia = k->I_0 + C * k->I_3 * k->g_F;
        drive = C * T_3;
    } else {
        c_F = per_torque = T_3 = none;
        inertia = k->I_0;
        drive = pick(T_in * w < 0.0, a_X * T_in, T_in);
    }
    const REAL z_1 = k->g_12 * n_1, z_2 = n_2;
    const REAL G_11 = inertia + y_1 * m_1 + y_2 * m_2;
    const REAL G_12 = y_1 * m_1 * k->k_1 - y_2 * m_2 * k->k_2;
    const REAL G_21 = z_1 * m_1 - z_2 * m_2;
    const REAL G_22 = z_1 * m_1 * k->k_1 + z_2 * m_2 * k->k_2 + k->I_s;
    const REAL R_1 = drive - a_X * X - y_1 * r_1 - y_2 * r_2;
    const REAL R_2 = z_2 * r_2 - z_1 * r_1 - k->l_s * s;
    const REAL det = G_11 * G_22 - G_12 * G_21;
    const REAL e_0 = OF(quotient)(job, R_1 * G_22 - R_2 * G_12, det);
    const REAL e_s = OF(quotient)(job, G_11 * R_2 - G_21 * R_1, det);
    const REAL M_1 = m_1 * (e_0 + k->k_1 * e_s) + r_1;
    const REAL M_2 = m_2 * (e_0 - k->k_2 * e_s) + r_2;
    const REAL M_F = per_torque * (T_3 - k->I_3 * k->g_F * e_0);

    const REAL F_1x = x_1 * M_1, F_2x = x_2 * M_2;
    const MASK back = w < 0.0;
    REAL N = n_1 * M_1 + n_2 * M_2, C = pick(has_drive, c_F * M_F, T_in);
    REAL bracket = X - F_1x - F_2x;
    bracket = pick(back, -bracket, bracket);
    N = pick(back, -N, N);
    C = pick(back, -C, C);
    bracket = pick(N > 0.0, bracket + N, bracket);
    bracket = pick(C < 0.0, bracket - C, bracket);
    N = pick(w == 0.0, none, N);
    result->e_0 = e_0;
    result->e_s = e_s;
    result->F_1 = F_1 + F_1x;
    result->F_2 = F_2 + F_2x;
    result->M_1 = M_1;
    result->M_2 = M_2;
    result->M_F = M_F;
    result->sign = sign;
    REAL *v = result->solved;
    v[0] = n_1, v[1] = n_2, v[2] = p_1, v[3] = p_2, v[4] = m_1, v[5] = m_2, v[6] = y_1;
    v[7] = y_2, v[8] = X, v[9] = a_N, v[10] = a_X, v[11] = inertia, v[12] = G_11, v[13] = G_12;
    v[14] = G_21, v[15] = G_22, v[16] = det;
    const REAL other_N = pick(h_N != 0.0, -N, N), other_b = pick(b != 0.0, -bracket, bracket);
    const REAL others[] = {-M_1 * s_1, -M_2 * s_2, -M_F * s_F, other_N, other_b};
    const MASK agrees = (others[0] <= 0.0) & (others[1] <= 0.0) & (others[2] <= 0.0)
        & (others[3] <= 0.0) & (others[4] <= 0.0);
    *found = sign;
    if (!any(opposite(agrees)))
        return none;
    const OF(signs) its = {pick(M_1 >= 0.0, one, -one), pick(M_2 >= 0.0, one, -one),
                           pick(M_F >= 0.0, one, -one), pick(N > 0.0, one, none),
                           pick(bracket > 0.0, one, none)};
    found->s_1 = pick(agrees, s_1, its.s_1);
    found->s_2 = pick(agrees, s_2, its.s_2);
    found->s_F = pick(agrees, s_F, its.s_F);
    found->h_N = pick(agrees, h_N, its.h_N);
    found->b = pick(agrees, b, its.b);
    REAL wrong = others[0];
    for (int n = 1; n < 5; n++)
        wrong = pick(others[n] > wrong, others[n], wrong);
    return pick(agrees, none, wrong);
}

/* Put the sign of each speed, smooth around zero, and of the slip in the clutches into state. */
static void find_signs(OF(step) *job, REAL w, REAL s, REAL *state)
{
    const OF(coefficients) *k = job->coefficients;
    const REAL k_1s = k->k_1 * s, k_2s = k->k_2 * s;
    state[2] = tanh_of(OF(quotient)(job, w, k->sign_speed));
    state[3] = tanh_of(OF(quotient)(job, w + k_1s, k->sign_speed));
    state[4] = tanh_of(OF(quotient)(job, w - k_2s, k->sign_speed));
    state[5] = tanh_of(k->a_1 * s);
    state[6] = tanh_of(k->a_2 * s);
}

/* Put L_k - T_k with the friction of the preload into q; return signs to begin with. */
static OF(signs) first_guess(const OF(step) *job, const REAL *state, REAL *q)
{
    const OF(coefficients) *k = job->coefficients;
    const REAL *u = job->u, one = fill(1.0), none = fill(0.0);
    const REAL w = state[0], k_1s = k->k_1 * state[1], k_2s = k->k_2 * state[1];
    q[0] = u[S_ONE] * state[5] + k->l_1 * k_1s - u[T_ONE];
    q[1] = u[S_TWO] * state[6] - k->l_2 * k_2s - u[T_TWO];
    const REAL both = q[0] + q[1];
    return (OF(signs)){pick(q[0] >= 0.0, one, -one), pick(q[1] >= 0.0, one, -one),
                       pick(both >= 0.0, one, -one), pick(both * w > 0.0, one, none), one};
}

/* Return the Jacobian of the motion at a point, at fixed signs. */
static OF(matrix) jacobian_at(OF(step) *job, const OF(point) *at)
{
    const OF(coefficients) *k = job->coefficients;
    const REAL T_in = job->u[T_IN], S_1 = job->u[S_ONE], S_2 = job->u[S_TWO];
    const REAL M_1 = at->M_1, M_2 = at->M_2, M_F = at->M_F;
    const REAL s_1 = at->sign.s_1, s_2 = at->sign.s_2, s_F = at->sign.s_F;
    const REAL h_N = at->sign.h_N, b = at->sign.b;
    const REAL w = at->state[0], sigma_0 = at->state[2], sigma_1 = at->state[3];
    const REAL sigma_2 = at->state[4], t_1 = at->state[5], t_2 = at->state[6];
    const REAL *v = at->solved;
    const REAL n_1 = v[0], n_2 = v[1], p_1 = v[2], p_2 = v[3], y_1 = v[6], y_2 = v[7];
    const REAL X = v[8], a_N = v[9], a_X = v[10], G_11 = v[12], G_12 = v[13], G_21 = v[14];
    const REAL G_22 = v[15], det = v[16];
    const REAL one = fill(1.0), none = fill(0.0);
    const REAL n_1w = OF(quotient)(job, k->half_1 * s_1 * (1 - sigma_1 * sigma_1), k->sign_speed);
    const REAL n_2w = OF(quotient)(job, k->half_2 * s_2 * (1 - sigma_2 * sigma_2), k->sign_speed);
    const REAL n_1s = n_1w * k->k_1, n_2s = -n_2w * k->k_2;
    const REAL u_1 = k->a_1 * (1 - t_1 * t_1), u_2 = k->a_2 * (1 - t_2 * t_2);
    const REAL phi_1 = pick(s_1 > 0.0, k->phi_1, k->psi_1);
    const REAL phi_2 = pick(s_2 > 0.0, k->phi_2, k->psi_2);
    const REAL x_1s = phi_1 * s_1 * u_1, x_2s = phi_2 * s_2 * u_2;
    const REAL q_1s = k->l_1 * k->k_1 + S_1 * u_1, q_2s = S_2 * u_2 - k->l_2 * k->k_2;
    const REAL M_1w = OF(quotient)(job, M_1 * n_1w, p_1);
    const REAL M_1s = OF(quotient)(job, q_1s + M_1 * (n_1s + x_1s), p_1);
    const REAL M_2w = OF(quotient)(job, M_2 * n_2w, p_2);
    const REAL M_2s = OF(quotient)(job, q_2s + M_2 * (n_2s + x_2s), p_2);
    REAL g_w = (M_1 * a_N * n_1w + y_1 * M_1w + M_2 * a_N * n_2w + y_2 * M_2w + a_X * k->l_0);
    const REAL g_s = (M_1 * (a_N * n_1s - a_X * x_1s) + y_1 * M_1s
                      + M_2 * (a_N * n_2s - a_X * x_2s) + y_2 * M_2s - a_X * (q_1s + q_2s));
    const REAL sigma_w = OF(quotient)(job, 1 - sigma_0 * sigma_0, k->sign_speed);
    const MASK has_drive = k->g_F != 0.0, turns = sigma_w != 0.0;
    if (any(has_drive | turns)) {
        const REAL side = pick(w < 0.0, -one, one);
        const REAL beta_w = k->bearing_0 * side * sigma_w * b;
        const REAL N = n_1 * M_1 + n_2 * M_2;
        const REAL x_M = phi_1 * t_1 * s_1 * M_1 + phi_2 * t_2 * s_2 * M_2;
        g_w = pick(has_drive | turns, g_w + beta_w * (h_N * N + X - x_M), g_w);
        if (any(has_drive)) {
            const REAL h = k->half_F * sigma_0 * s_F;
            const REAL n_F = k->mean_F + h, c_F = k->mean_F - h;
            const REAL n_Fw = k->half_F * s_F * sigma_w;
            const REAL beta_3 = k->bearing_3 * absolute(sigma_0);
            const REAL beta_3w = k->bearing_3 * side * sigma_w;
            const MASK drives = w * s_F > 0.0;
            const REAL a_P = pick(drives, 1 + beta_3, one), a_Pw = pick(drives, beta_3w, none);
            const REAL a_C = pick(drives, one, a_X), a_Cw = pick(drives, none, beta_w);
            REAL T_3w = -k->l_3 * k->g_F * (1 + beta_3 + beta_3w * w);
            T_3w = pick(T_in * k->g_F * w < 0.0, T_3w + T_in * beta_3w, T_3w);
            const REAL M_Fw = (OF(quotient)(job, k->g_F, a_P * n_F) * T_3w
                               - M_F * (OF(quotient)(job, a_Pw, a_P)
                                        + OF(quotient)(job, n_Fw, n_F)));
            g_w -= a_Cw * c_F * M_F + a_C * (c_F * M_Fw - n_Fw * M_F);
        } else {
            g_w = pick(turns & (T_in * w < 0.0), g_w - beta_w * T_in, g_w);
        }
    }
    const REAL r_w = k->g_12 * (n_1w * M_1 + n_1 * M_1w) - n_2w * M_2 - n_2 * M_2w;
    const REAL r_s = k->g_12 * (n_1s * M_1 + n_1 * M_1s) - n_2s * M_2 - n_2 * M_2s + k->l_s;
    return (OF(matrix)){OF(quotient)(job, G_12 * r_w - G_22 * g_w, det),
                        OF(quotient)(job, G_12 * r_s - G_22 * g_s, det),
                        OF(quotient)(job, G_21 * g_w - G_11 * r_w, det),
                        OF(quotient)(job, G_21 * g_s - G_11 * r_s, det)};
}

static MASK bends_between(const OF(step) *job, const OF(point) *here, const OF(point) *there)
{
    const OF(coefficients) *k = job->coefficients;
    const OF(signs) *a = &here->sign, *b = &there->sign;
    MASK stays = (a->s_1 == b->s_1) & (a->s_2 == b->s_2) & (a->s_F == b->s_F)
        & (a->h_N == b->h_N) & (a->b == b->b);
    for (int n = 2; n < STATE; n++) {
        const REAL change = there->state[n] - here->state[n];
        stays &= (-STRAIGHT < change) & (change < STRAIGHT);
    }
    const REAL v_w = here->e_0, v_s = here->e_s, w_w = there->e_0, w_s = there->e_s;
    stays &= (v_w * w_w >= 0.0) & (v_s * w_s >= 0.0)
        & ((v_w + k->k_1 * v_s) * (w_w + k->k_1 * w_s) >= 0.0)
        & ((v_w - k->k_2 * v_s) * (w_w - k->k_2 * w_s) >= 0.0);
    return opposite(stays);
}
