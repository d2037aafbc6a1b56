/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * What the equations are about, made of REAL: see real.h.
 */

typedef struct {
    REAL w, s;
} OF(pair);

typedef struct {
    REAL ww, ws, sw, ss;
} OF(matrix);

typedef struct {
    REAL s_1, s_2, s_F, h_N, b;
} OF(signs);

/*
 * All that is known of one state. Under the passive law signs, state and solved are those of
 * passive.py; under the paper's law state begins with t_1, t_2, x_1, x_2 of clutched.py.
 */
typedef struct {
    REAL e_0, e_s, F_1, F_2, M_1, M_2, M_F;
    OF(signs) sign;
    REAL state[STATE];
    REAL solved[SOLVED];
} OF(point);

/* What does not change while the parameters stay, in the order of passive.Coefficients. */
typedef struct {
    REAL sign_speed, g_12, k_1, k_2, g_F, I_0, I_1, I_2, I_3, I_s, l_0, l_1, l_2, l_3, l_s;
    REAL mean_1, mean_2, mean_F, half_1, half_2, half_F, bearing_0, bearing_3;
    REAL a_1, a_2, phi_1, phi_2, psi_1, psi_2;
} OF(coefficients);

/* The same of the paper's law with clutches, in the order of clutched.Coefficients. */
typedef struct {
    REAL A_ww, A_ws, A_sw, A_ss, C_w1, C_w2, C_s1, C_s2, P_1w, P_1s, P_2w, P_2s;
    REAL W_11, W_12, W_21, W_22, B_w0, B_w1, B_w2, B_s0, B_s1, B_s2;
    REAL Q_10, Q_11, Q_12, Q_20, Q_21, Q_22, a_1, a_2, phi_1, phi_2, psi_1, psi_2;
} OF(clutched_coefficients);

/* All that goes on from tick to tick, as in motion/state.py. */
typedef struct {
    REAL x[2], turned[2], origin[SHAFTS], torque[PORTS], flow, memory[CLUTCHES];
    REAL force[CLUTCHES], held[PORTS];
    REAL ticks, coarse_steps;
    REAL seen[STATE];     /* of the last point of the passive law: what need not be found again */
} OF(state);

/* What is exact for one response and one length of step. */
typedef struct {
    REAL step[4][5];      /* rows of w and s, then of their integrals; of (w, s, T_3, T_1, T_2) */
    REAL moments[3][5];
} OF(exact);

/* What must hold on the way of an exact step under the passive law. */
typedef struct {
    REAL slope[2][5], kept[KEPT][6], input_sign, reach[2];
} OF(way);
