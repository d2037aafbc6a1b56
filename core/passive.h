/* Copyright 2026 dm_ros developers
 * SPDX-License-Identifier: Apache-2.0
 *
 * The passive law of losses and its adaptive step, line by line as in Python:
 * dm_ros/mechanism/passive.py, dm_ros/motion/adaptive.py, exponentials.py, quadrature.py and
 * meters.py, where the equations and their reasons are told. Equal inputs give equal bits.
 */

#ifndef DM_ROS_PASSIVE_H
#define DM_ROS_PASSIVE_H

enum { STATE = 7, SOLVED = 17, LOST = 8 };

/* What does not change while the parameters stay, in the order of passive.Coefficients. */
typedef struct {
    double sign_speed, g_12, k_1, k_2, g_F, I_0, I_1, I_2, I_3, I_s, l_0, l_1, l_2, l_3, l_s;
    double mean_1, mean_2, mean_F, half_1, half_2, half_F, bearing_0, bearing_3;
    double a_1, a_2, phi_1, phi_2, psi_1, psi_2;
} coefficients;

/* What is held in a step, N m. */
typedef struct {
    double T_in, T_1, T_2, S_1, S_2;
} held;

typedef struct {
    double w, s;
} pair;

typedef struct {
    double ww, ws, sw, ss;
} matrix;

typedef struct {
    double s_1, s_2, s_F, h_N, b;
} signs;

/* All that is known of one state; signs, state and solved as in passive.py. */
typedef struct {
    double e_0, e_s, F_1, F_2, M_1, M_2, M_F;
    signs sign;
    double state[STATE];
    double solved[SOLVED];
} point;

/* A step: what is asked for, and what comes out. */
typedef struct {
    const coefficients *k;
    held u;
    double h, tolerance;
    double form[3];    /* of the kinetic energy: m_ww, m_ws, m_ss */
    int has_books;
    int broken;        /* a number divided by zero, which ends the step as it does in Python */
    pair end, integral;
    point at_end;
    int coarse;
    double lost[LOST], numerical;
} step;

/* Return the point at the carrier speed w and the slip s. */
point dm_evaluate(step *job, double w, double s);

/* Advance from y; return 0, or -1 where no speed in reach fits or a number divided by zero. */
int dm_advance(step *job, pair y);

#endif
